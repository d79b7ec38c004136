"""Predict the torques of a plan, and compare them with their limits before it is executed."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
import math
from typing import Any, TYPE_CHECKING

from lip_id_ros.cli import arguments

if TYPE_CHECKING:
    from lip_id_ros.evaluation.tables import Table
    from lip_id_ros.feedforward.plan_check import PlanCheck

HELP = 'compare the torques of a plan with their limits'
EPILOG = """\
examples:
  lip_id check-plan arm.npz plan.yaml --limits 87,87,87,87,12,12,12
  lip_id check-plan arm.npz plan.mcap --urdf arm.urdf          limits of the URDF
  lip_id check-plan arm.npz plan.yaml --params serve.yaml      torque_limits of serve

A plan is a JointTrajectory, or a goal with one: in YAML, as `ros2 topic echo --full-length` prints
it, or on a topic of a bag. It is interpolated as the joint_trajectory_controller does. Ends with 1
where a plan does not fit.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    parser.add_argument(
        'plan', type=arguments.source, metavar='PLAN', help='.yaml file or bag with the plan'
    )
    limits = parser.add_mutually_exclusive_group(required=True)
    limits.add_argument(
        '--limits',
        type=torques,
        metavar='A,B,...',
        help='largest torques of the joints of the model [N m or N], or one for all',
    )
    limits.add_argument(
        '--urdf', type=arguments.source, metavar='FILE', help='take the limits of a URDF'
    )
    limits.add_argument(
        '--params',
        type=arguments.source,
        metavar='FILE',
        help='take torque_limits and joints of serve from its parameter file',
    )
    parser.add_argument(
        '--sigmas',
        type=arguments.standard_deviations,
        default=0.0,
        metavar='K',
        help='stay K standard deviations of the torque away from the limits (default: 0)',
    )
    parser.add_argument('--topic', default='', help='topic of the bag, where several have plans')
    arguments.add_json(parser)
    arguments.add_force(parser)


def torques(text: str) -> tuple[float, ...]:
    """Read torques above zero; argparse.ArgumentTypeError if there is anything else."""
    try:
        values = tuple(float(part) for part in text.split(','))
    except ValueError:
        values = ()
    if not values or not all(0.0 < value < math.inf for value in values):
        raise argparse.ArgumentTypeError(f'expected numbers above 0 with commas, got {text!r}')
    return values


def run(args: argparse.Namespace) -> None:
    """Check every plan of the file, and show what was found."""
    from lip_id_ros.cli import models, output
    from lip_id_ros.errors import DataError
    from lip_id_ros.evaluation.tables import show, show_lines
    from lip_id_ros.feedforward.plan_check import check_plan
    from lip_id_ros.feedforward.plan_files import read_plans

    inputs = [args.model, args.plan, *filter(None, [args.urdf, args.params])]
    output.check_json(args.json, inputs, args.force)
    model = models.load(args.model)
    limits = _limits(args, model.joint_names)
    plans = read_plans(args.plan, args.topic)
    checks = [check_plan(model, plan, limits, sigmas=args.sigmas) for plan in plans]
    console = output.console(args.json)
    for number, check in enumerate(checks, start=1):
        title = f'Plan {number} of {len(checks)}' if len(checks) > 1 else 'Plan'
        show(_table(f'{title}, {check.duration_s:.3g} s', model.joint_types, check), console)
        show_lines([*filter(None, [check.caution]), verdict(check)], console)
    output.write_json(args.json, {'plans': [figures(check) for check in checks]})
    if unfit := [number for number, check in enumerate(checks, start=1) if not check.fits]:
        which = f'plans {", ".join(map(str, unfit))}' if len(checks) > 1 else 'the plan'
        raise DataError(
            f'{which} of {args.plan} must stay within the limits of all joints, but does not; '
            'execute it slower, or change it.'
        )


def _limits(args: argparse.Namespace, joint_names: Sequence[str]) -> tuple[float, ...]:
    """Return limits in the order of the model's joints [N m or N]."""
    from pathlib import Path

    from lip_id_ros.description.limits import effort_limits
    from lip_id_ros.errors import ConfigError
    from lip_id_ros.feedforward.settings import make_rules, ServeSettings
    from lip_id_ros.settings.sections import parameters_in_file
    from lip_id_ros.signals.torque_steps import LimitsFrom

    if args.limits is not None:
        given: tuple[float, ...] = args.limits
        return given
    if args.urdf is not None:
        return effort_limits(Path(args.urdf).read_text(), args.urdf, joint_names)
    found = parameters_in_file(args.params, '/serve')
    names = ('joints', 'torque_limits', 'torque_limits_from')
    settings = ServeSettings(**{name: found[name] for name in names if name in found})
    if not settings.torque_limits or settings.torque_limits_from != LimitsFrom.PARAMETERS:
        raise ConfigError(
            f'torque_limits in {args.params} must be numbers here; give --limits or --urdf.'
        )
    return tuple(make_rules(settings, joint_names).limits.tolist())


def _table(title: str, joint_types: Sequence[str], check: PlanCheck) -> Table:
    from lip_id_ros.evaluation.tables import Table
    from lip_id_ros.joint_types import TORQUE_UNITS

    header = ('', 'limit', 'torque', 'standard deviation', 'of the limit [%]', 'at', 'beyond it')
    rows = []
    for load, kind in zip(check.loads, joint_types, strict=True):
        unit = TORQUE_UNITS[kind]
        beyond = ', '.join(f'{begin:.3f} to {end:.3f} s' for begin, end in load.beyond_s[:3])
        more = ', ...' if len(load.beyond_s) > 3 else ''
        rows.append(
            (
                *(load.joint, f'{load.limit:.3g} {unit}', f'{load.tau:.3g} {unit}'),
                *(f'{load.std:.2g} {unit}', f'{100.0 * abs(load.tau) / load.limit:.1f}'),
                *(f'{load.at_s:.3f} s', f'{beyond}{more}'),
            )
        )
    return Table(title, header, rows)


def verdict(check: PlanCheck) -> str:
    """Return what follows from a check, as a sentence."""
    from lip_id_ros.feedforward.plan_check import SLOWEST

    if check.fits:
        return 'The plan fits.'
    if check.scale is None:
        return f'The plan does not fit, not in {SLOWEST:g} times its time either.'
    scale = math.ceil(1e3 * check.scale) / 1e3  # with one rounded down it would not fit
    return f'The plan does not fit. It does in {scale:.3f} times its time.'


def figures(check: PlanCheck) -> Mapping[str, Any]:
    """Return a check as JSON has it."""
    from dataclasses import asdict

    loads = [{**asdict(load), 'excess': load.excess} for load in check.loads]
    return {
        'fits': check.fits,
        'scale': check.scale,
        'caution': check.caution,
        'duration_s': check.duration_s,
        'joints': loads,
    }
