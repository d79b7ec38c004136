"""A designed motion in tables and sentences."""

from __future__ import annotations

from lip_id_ros.evaluation.tables import Table
from lip_id_ros.excitation.planning import ExcitingMotion
from lip_id_ros.export.friction_table import Coefficient, friction_table
from lip_id_ros.joint_types import POSITION_UNITS, TORQUE_UNITS


def motion_table(found: ExcitingMotion) -> Table:
    """Return what each joint does, and how much of its limits it uses at most."""
    ends = found.position_ends
    header = ('', 'posture', 'from', 'to', 'velocity', 'acceleration', 'jerk')
    rows = []
    for j, (name, kind) in enumerate(zip(found.joint_names, found.joint_types, strict=True)):
        places = (found.motion.posture[j], ends[0, j], ends[1, j])
        of_limits = (
            f'{peak:.3g} of {limit:.3g}'
            for peak, limit in zip(
                found.peaks[1:, j], (each[j] for each in found.limits.derivatives), strict=True
            )
        )
        rows.append(
            (f'{name} [{POSITION_UNITS[kind]}]', *(f'{q:.3f}' for q in places), *of_limits)
        )
    title = f'Motion of {found.motion.duration:g} s, with the largest values beside their limits'
    return Table(title, header, rows)


def learning_tables(found: ExcitingMotion) -> list[Table]:
    """Return what was unknown before the motion and will be after it; nothing without a model."""
    if found.learning is None:
        return []
    deviations = (
        *found.learning.torque_std,
        *found.learning.gravity_std,
        *found.learning.inertia_std,
    )
    rows = [
        (f'{name} [{TORQUE_UNITS[kind]}]', *(f'{each[j]:.3g}' for each in deviations))
        for j, (name, kind) in enumerate(zip(found.joint_names, found.joint_types, strict=True))
    ]
    header = ('', 'torque, before', 'after', 'at rest, before', 'after', 'M, before', 'after')
    title = (
        'Standard deviations where torques are wanted: of torques, and of the own inertia M_jj '
        '[kg m² or kg]'
    )
    torques = Table(title, header, rows)
    tables = (friction_table(model) for model in (found.learning.before, found.learning.after))
    terms = [
        (old.joint, old.term, f'{old.value:.4g}', _deviation(old), _deviation(new), old.unit)
        for old, new in zip(*tables, strict=True)
    ]
    columns = ('', 'term', 'coefficient', 'deviation before', 'after', 'unit')
    return [torques, Table('Friction', columns, terms)]


def _deviation(of: Coefficient) -> str:
    return '' if of.std is None else f'{of.std:.2g}'


def motion_lines(found: ExcitingMotion) -> list[str]:
    """Return sentences on how far and how fast a motion goes, and on what it gains."""
    count = len(found.design.drawn)
    lines = [
        *found.sentences,
        f'Best of {count} random motions: the expected squared error of torques after it is '
        f'{found.gain:.2f} of that after the median draw.',
    ]
    if found.learning is not None and found.limits.torque is None:
        lines.append('Torques have no limit here; give motion.torque_limits, or a URDF.')
    return lines
