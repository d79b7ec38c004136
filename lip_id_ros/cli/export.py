"""Write an identified arm as URDF, MJCF or a C header."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from lip_id_ros.cli import arguments
from lip_id_ros.errors import ConfigError

if TYPE_CHECKING:
    from lip_id_ros.export.formats import Template
    from lip_id_ros.model import InverseDynamicsModel

HELP = 'write an identified arm as URDF, MJCF, C or a package in C++'
EPILOG = """\
example:
  lip_id export arm.npz --urdf arm.urdf --mjcf arm.xml --c arm_dynamics.h
  lip_id export arm.npz --solver-package my_ws/src/arm_solver     a plugin of
                                                                  inverse_dynamics_solver
  lip_id export arm.npz --urdf fitted.urdf --template arm.urdf    the URDF that the fit started
                                                                  from, with what was fitted
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    parser.add_argument('--urdf', metavar='FILE', help='write a URDF')
    parser.add_argument(
        '--template',
        type=arguments.source,
        metavar='FILE',
        help='URDF that the model was fitted with: its text with fitted inertials, damping and '
        'friction is written to --urdf',
    )
    parser.add_argument(
        '--origins', action='store_true', help='with --template: replace the origins of joints too'
    )
    parser.add_argument(
        '--mjcf', metavar='FILE', help='write an MJCF for MuJoCo (needs the extra `export`)'
    )
    parser.add_argument('--c', metavar='FILE', help='write a C header with all constants')
    parser.add_argument(
        '--solver-package',
        metavar='FOLDER',
        help='write a ROS 2 package in C++: a plugin of inverse_dynamics_solver, with friction',
    )
    parser.add_argument(
        '--name', help='name of the arm in the files (default: that of the model file)'
    )
    arguments.add_force(parser)


def _is_exported(path: Path) -> bool:
    content = path.read_bytes()
    # our own files begin with the words, and filled templates end with them
    return any(b'identified by lip_id_ros' in part for part in (content[:4000], content[-4000:]))


def run(args: argparse.Namespace) -> None:
    """Write the files, all or none."""
    from lip_id_ros.cli import output
    from lip_id_ros.evaluation import fit_cautions
    from lip_id_ros.evaluation.tables import show_lines
    from lip_id_ros.export.arm import describe
    from lip_id_ros.export.c_header import identifier
    from lip_id_ros.export.formats import FORMATS, formatted, HEADER
    from lip_id_ros.export.kinematics import model_kinematics
    from lip_id_ros.export.solver_package import require_own, save, solver_package
    from lip_id_ros.export.urdf_template import template_remarks
    from lip_id_ros.model import InverseDynamicsModel
    from lip_id_ros.model.serialization import contradictions

    targets = _targets(args, FORMATS)
    output.check_distinct(*targets.values())
    inputs = [args.model, *filter(None, [args.template])]
    for format_name, target in targets.items():
        kind = f'an arm exported as {format_name}'
        output.check_file(target, inputs, _is_exported, kind, args.force)
    if args.solver_package is not None:
        require_own(args.solver_package, args.force)
    model = InverseDynamicsModel.load(args.model)
    with contradictions(args.model):
        model_kinematics(model)
        lines = fit_cautions(model)
    name = identifier(Path(args.model).stem if args.name is None else args.name)
    exported = describe(model, name)
    console = output.console()
    residual_gp = exported.residual_gp
    template = _template(args, model)
    files = {
        name: formatted(name, exported, template if name == 'urdf' else None) for name in targets
    }
    header = None if args.solver_package is None else formatted(HEADER, exported)
    package = {} if header is None else solver_package(exported.arm, header.text)
    for format_name, file in files.items():
        file.save(targets[format_name])
        show_lines([f'Written: {targets[format_name]}'], console)
        lines += file.left_out
    if header is not None:
        save(package, args.solver_package)
        show_lines([f'Written: {args.solver_package}'], console)
    if residual_gp is not None:
        lines.append(f'Left out: {residual_gp}. Torques of the files are less accurate there.')
    if template is not None:
        arm = files['urdf'].exported.arm
        lines += template_remarks(arm, template.description, args.origins)
    show_lines(lines, console)


def _targets(args: argparse.Namespace, names: Iterable[str]) -> dict[str, str]:
    targets = {name: getattr(args, name) for name in names if getattr(args, name) is not None}
    if not targets and args.solver_package is None:
        raise ConfigError(
            '--urdf, --mjcf or --c with a file, or --solver-package was expected, but none came.'
        )
    if args.template is not None and args.urdf is None:
        raise ConfigError('--template is written to --urdf, which is missing; add it.')
    if args.origins and args.template is None:
        raise ConfigError('--origins replaces those of --template, which is missing; add it.')
    return targets


def _template(args: argparse.Namespace, model: InverseDynamicsModel) -> Template | None:
    if args.template is None:
        return None
    from lip_id_ros.description.urdf import load_description
    from lip_id_ros.export.formats import Template
    from lip_id_ros.export.urdf_template import require_same_frames

    description = load_description(args.template, model.joint_names, model.joint_types)
    require_same_frames(model, description)
    return Template(description, args.origins)
