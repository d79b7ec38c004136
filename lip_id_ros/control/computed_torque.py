"""Computed torque (paper, eq. `CT_control`): feedforward plus PD, in a loop and along a plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.settings import executor_setting, setting, Settings
from lip_id_ros.settings.settings import AT_START
from lip_id_ros.signals.joint_states import JointStateReader, StampWatch
from lip_id_ros.signals.joints import (
    increasing_times,
    JointOrder,
    PlannedPoint,
    Refusal,
    RefusedError,
    require_unique,
)
from lip_id_ros.signals.status import Level, Status, Tally

if TYPE_CHECKING:  # numba, which the node starts without
    from lip_id_ros.model import DynamicsModel


class Feedforward(Protocol):
    """Inverse dynamics of one state; q, dq and ddq have shape (n,)."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""


class NoFeedforward:
    """Leave all the work to the feedback."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return zeros."""
        return np.zeros_like(q)


class LearnedFeedforward:
    """Torques of a learned model."""

    def __init__(self, model: DynamicsModel) -> None:
        self._model = model

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""
        return self._model.query(q, dq, ddq).tau


@dataclass(frozen=True)
class Gains:
    """
    Diagonals of the feedback's matrices.

    Attributes
    ----------
    stiffness : ndarray, shape (n,)
        K_p: torque per position error [N m/rad or N/m].
    damping : ndarray, shape (n,)
        K_d: torque per velocity error [N m s/rad or N s/m].

    """

    stiffness: Array
    damping: Array

    def feedback(self, q_error: Array, dq_error: Array) -> Array:
        """Torques [N m or N], shape (n,), against errors of position and velocity."""
        return self.stiffness * q_error + self.damping * dq_error


@dataclass(frozen=True)
class Torques:
    """The two parts of a command, each of shape (n,) [N m or N]."""

    feedforward: Array
    feedback: Array

    @property
    def command(self) -> Array:
        """Their sum."""
        return self.feedforward + self.feedback


class ComputedTorque:
    """Torques that follow a reference."""

    def __init__(self, feedforward: Feedforward, gains: Gains) -> None:
        self._feedforward = feedforward
        self._gains = gains

    def torques(self, reference: tuple[Array, Array, Array], q: Array, dq: Array) -> Torques:
        """
        Compute the command of one control period.

        Parameters
        ----------
        reference : tuple of ndarray, each of shape (n,)
            Positions, velocities and accelerations to follow.
        q, dq : ndarray, shape (n,)
            Measured.

        """
        feedback = self._gains.feedback(reference[0] - q, reference[1] - dq)
        return Torques(self._feedforward.torque(*reference), feedback)


LARGEST = 1e6
"""No position, velocity or effort of an arm is larger, in SI units."""


@dataclass(frozen=True)
class ControlSettings(Settings):
    """The node `computed_torque`."""

    joints: tuple[str, ...] = setting(
        (), 'Joints to control, in the order of the gains.', applies=AT_START
    )
    stiffness: tuple[float, ...] = setting(
        (),
        'Torque per position error, per joint.',
        unit='N m/rad or N/m',
        minimum=0.0,
        applies=AT_START,
    )
    damping: tuple[float, ...] = setting(
        (),
        'Torque per velocity error, per joint.',
        unit='N m s/rad or N s/m',
        minimum=0.0,
        applies=AT_START,
    )
    torque_limits: tuple[float, ...] = setting(
        (),
        'Largest magnitude of each torque; empty for none.',
        unit='N m or N',
        minimum=0.0,
        applies=AT_START,
    )
    executor: str = executor_setting()


class EffortPoint(PlannedPoint, Protocol):
    """A point of a plan with feedforward."""

    @property
    def effort(self) -> Sequence[float]:
        """Feedforward [N m or N]; empty for none."""


class PlanController:
    """
    Follow plans; without one there is no torque.

    Stamps of joint states are the clock of a plan. They are judged as `train` does: one that goes
    back or far ahead is refused, and where the clock did jump, the plan is dropped.

    Raises
    ------
    ConfigError
        If there is no joint or one comes twice, or a list has another length than there are.

    """

    def __init__(self, settings: ControlSettings) -> None:
        n = len(settings.joints)
        require_unique('joints', settings.joints)
        if n == 0:
            raise ConfigError('joints must name the joints to control, but is empty.')
        for name in ('stiffness', 'damping'):
            _require_length(name, getattr(settings, name), n)
        if settings.torque_limits:
            _require_length('torque_limits', settings.torque_limits, n)
        self._gains = Gains(np.array(settings.stiffness), np.array(settings.damping))
        self._limits = np.array(settings.torque_limits or [np.inf] * n)
        self._planned = JointOrder(settings.joints)
        self._reader = JointStateReader(settings.joints)
        self._stamps = StampWatch()
        self._jumps = 0
        self._plan: _Plan | None = None
        self._tally = Tally('plans', 'torques', 'idle')

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints, in the order of torques."""
        return self._planned.joint_names

    def take(self, names: Sequence[str], points: Sequence[EffortPoint]) -> None:
        """
        Follow a plan from the next measurement on.

        Parameters
        ----------
        names : sequence of str
            Its joints.
        points : sequence of EffortPoint
            Efforts at all of them, or at none.

        Raises
        ------
        RefusedError
            If it cannot be followed; the plan before goes on.

        """
        with self._tally.receiving():
            self._plan = self._read(names, points)
            self._tally.used['plans'] += 1

    def torques(self, message: JointMessage) -> Array | None:
        """
        Answer a measurement.

        Parameters
        ----------
        message : JointMessage
            With positions and velocities of all joints; its stamp is the clock of the plan.

        Returns
        -------
        ndarray, shape (n,), or None
            Effort of the plan plus feedback, within the limits [N m or N], in the order of
            `joint_names`; None without a plan.

        Raises
        ------
        RefusedError
            If its stamp is doubted, a joint is missing, or a number is missing or not finite.

        """
        with self._tally.receiving():
            self._reader.columns(message)
            self._judge(message.stamp_ns)
            command = None if self._plan is None else self._command(self._plan, message)
            self._tally.used['idle' if command is None else 'torques'] += 1
            return command

    def status(self) -> Status:
        """Return the counts, which add up to `received`; warn of refusals since the last call."""
        tally = self._tally
        values = {'received': tally.received, **tally.used, 'refused': dict(tally.refused)}
        refused = ', '.join(f'{key} {n}' for key, n in sorted(tally.new_refusals().items()))
        if refused:
            return Status(Level.WARN, f'messages refused: {refused}', values)
        return Status(Level.OK, 'all messages are answered', values)

    def _read(self, names: Sequence[str], points: Sequence[EffortPoint]) -> _Plan:
        columns = self._planned.columns(names)
        motion = self._planned.states(names, points)
        efforts = {len(point.effort) for point in points}
        if efforts not in ({0}, {len(names)}):
            raise RefusedError(Refusal.WRONG_LENGTH)
        effort = np.zeros(motion.shape[1:])
        if efforts != {0}:
            effort = np.array([point.effort for point in points], dtype=np.float64)[:, columns]
        t = increasing_times(points)
        if len(t) < 2:
            raise RefusedError(Refusal.NOT_INCREASING)
        if not np.isfinite(effort).all():
            raise RefusedError(Refusal.NOT_FINITE)
        with np.errstate(over='ignore'):
            between = np.diff(motion[0], axis=0) / np.diff(t)[:, np.newaxis]  # velocities
        if max(np.abs(values).max() for values in (*motion[:2], between, effort)) > LARGEST:
            raise RefusedError(Refusal.TOO_LARGE)
        return _Plan(t, motion[0], motion[1], effort)

    def _command(self, plan: _Plan, message: JointMessage) -> Array:
        measured = self._reader.read(message)
        if max(np.abs(measured.q).max(), np.abs(measured.dq).max()) > LARGEST:
            raise RefusedError(Refusal.TOO_LARGE)  # its feedback would be the largest torque
        q_wanted, dq_wanted, effort = plan.at(message.stamp_ns)
        feedback = self._gains.feedback(q_wanted - measured.q, dq_wanted - measured.dq)
        command: Array = np.clip(effort + feedback, -self._limits, self._limits)
        if not np.isfinite(command).all():
            raise RefusedError(Refusal.NOT_FINITE_TORQUE)
        return command

    def _judge(self, stamp_ns: int) -> None:
        doubt = self._stamps.doubt(stamp_ns)
        # a joint state that is published again, since its torque was lost, gets the same
        if doubt not in (None, Refusal.REPEATED_STAMP):
            raise RefusedError(doubt)
        if self._stamps.jumps > self._jumps:
            self._jumps, self._plan = self._stamps.jumps, None


class _Plan:
    """Cubic positions and linear efforts between points; the last point is held."""

    def __init__(self, t: Array, q: Array, dq: Array, effort: Array) -> None:
        self._t, self._effort = t, effort
        self._q = CubicHermiteSpline(t, q, dq)
        self._dq = self._q.derivative()
        self._begin_ns: int | None = None

    def at(self, stamp_ns: int) -> tuple[Array, Array, Array]:
        if self._begin_ns is None:
            self._begin_ns = stamp_ns
        time = 1e-9 * (stamp_ns - self._begin_ns)
        within = min(max(time, self._t[0]), self._t[-1])
        row = min(int(np.searchsorted(self._t, within, side='right')), len(self._t) - 1)
        share = (within - self._t[row - 1]) / (self._t[row] - self._t[row - 1])
        effort = (1 - share) * self._effort[row - 1] + share * self._effort[row]
        dq = self._dq(within) if time == within else np.zeros(self._effort.shape[1])
        return np.asarray(self._q(within)), np.asarray(dq), effort


def _require_length(name: str, values: Sequence[float], n: int) -> None:
    if len(values) != n:
        raise ConfigError(
            f'{name} must have one number for each of {n} joints, but has {len(values)}.'
        )
