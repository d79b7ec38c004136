"""Compare a model's torques and energies with recordings."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lip_id_ros.cli import arguments
from lip_id_ros.errors import ConfigError, ModelError

if TYPE_CHECKING:
    from lip_id_ros.dataset import Dataset
    from lip_id_ros.evaluation.rollout import Rollouts
    from lip_id_ros.model import InverseDynamicsModel

HELP = 'compare a model with recordings: errors, energies, plots'
EPILOG = """\
examples:
  lip_id evaluate arm.npz other_bag
  lip_id evaluate arm.npz other_bag --report out    plots, and out/index.html with all of them
  lip_id evaluate arm.npz my_bag --last 0.3         the samples that fit --holdout 0.3 left out
  lip_id evaluate arm.npz other_bag --rollout       also simulate windows of the motion, driven by
                                                    the measured torques
  lip_id evaluate arm.npz other_bag --json -        figures for another program

Recordings are preprocessed with the settings of the fit, or with those of --config.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    arguments.add_model(parser)
    arguments.add_sources(parser)
    arguments.add_config(parser, "the settings of the model's fit")
    parser.add_argument(
        '--last',
        type=arguments.share,
        metavar='SHARE',
        help='evaluate the last share of the samples only',
    )
    arguments.add_json(parser)
    parser.add_argument(
        '--rollout',
        action='store_true',
        help='simulate windows of 0.1 and 1 s, driven by the measured torques, and compare the '
        'motion',
    )
    parser.add_argument(
        '--urdf',
        type=arguments.source,
        metavar='FILE',
        help='with --rollout: simulate the arm of this URDF as well',
    )
    parser.add_argument('--report', metavar='DIR', help='write plots and a web page there')
    arguments.add_force(parser)


def run(args: argparse.Namespace) -> None:
    """Evaluate, show and write."""
    from lip_id_ros.cli import models, output, show
    from lip_id_ros.evaluation import evaluation_cautions, score
    from lip_id_ros.evaluation import run as predict
    from lip_id_ros.evaluation.cautions import copy_cautions
    from lip_id_ros.evaluation.report import band, Labels, write_report
    from lip_id_ros.evaluation.rollout import rollout_cautions
    from lip_id_ros.evaluation.tables import rollout_tables, show_lines
    from lip_id_ros.evaluation.tables import show as show_table

    if args.urdf is not None and not args.rollout:
        raise ConfigError('--urdf is compared by --rollout, which is missing; add it.')
    inputs = [args.model, *args.sources]
    output.check_file(args.json, inputs, output.is_json, 'a JSON object', args.force)
    output.check_folder(args.report, args.force)
    model = models.load(args.model)
    sources = ', '.join(args.sources)
    rollouts = None
    with output.progress_display() as progress:
        if args.rollout:
            dataset, every = models.load_with_every_sample(
                model, args.sources, args.config, progress
            )
        else:
            dataset = models.load_for(model, args.sources, args.config, progress)
        if args.last is not None:
            _, dataset = dataset.split(1.0 - args.last)
            sources += f', the last {100 * args.last:g} %'
        outcome = predict(model, dataset, progress)
        evaluation = score(outcome)
        warnings = copy_cautions(dataset.provenance)
        if args.rollout:
            rollouts = _rollouts(model, _from_first(every, dataset), args.urdf)
            warnings += _not_simulated(model) + rollout_cautions(rollouts, model.joint_names)
        if args.report:
            facts = (
                ('model', args.model),
                ('recordings', sources),
                ('kernel', model.kernel),
                ('samples in the model', str(model.n_samples)),
            )
            labels = Labels('Inverse dynamics: model against measurement', warnings, facts)
            uncertainty = band(model, outcome, progress)
            page = write_report(
                args.report, outcome, evaluation, uncertainty, labels, progress, rollouts
            )
    console = output.console(args.json)
    show.evaluated(evaluation, f'{args.model} on {sources}', console)
    figures = evaluation.to_json()
    if rollouts is not None:
        for table in rollout_tables(rollouts, dataset.joint_names, dataset.joint_types):
            show_table(table, console)
        figures['rollout'] = rollouts.to_json()
    show_lines([*evaluation_cautions(evaluation), *warnings], console)
    if args.report:
        show_lines([f'Written: {page}'], console)
    output.write_json(args.json, figures)


def _from_first(every: Dataset, some: Dataset) -> Dataset:
    """Return the samples from the first of some of them on."""
    import numpy as np

    begun = (every.segment == some.segment[0]) & (every.t >= some.t[0])
    return every.select(np.arange(np.argmax(begun), every.n_samples))


def _rollouts(model: InverseDynamicsModel, dataset: Dataset, urdf: str | None) -> Rollouts:
    from lip_id_ros.description.urdf import load_description
    from lip_id_ros.evaluation.rollout import floor, nominal_arm, roll_out, Rollouts
    from lip_id_ros.model.forward_dynamics import ForwardDynamics

    if model.arm is None:
        raise ModelError(
            '--rollout simulates rigid links, which this model does not have; fit with the '
            'default kernel.'
        )
    arm = ForwardDynamics.fitted(model.arm)
    errors = Rollouts(roll_out(arm, dataset), floor(arm, dataset))
    if urdf is None:
        return errors
    description = load_description(urdf, dataset.joint_names, dataset.joint_types)
    couplings = model.arm.chain.couplings
    nominal = nominal_arm(description, dataset.gravity_compensated, couplings)
    return errors._replace(urdf=roll_out(nominal, dataset))


def _not_simulated(model: InverseDynamicsModel) -> list[str]:
    from lip_id_ros.export.arm import residual_gp_of

    residual_gp = residual_gp_of(model)
    return [] if residual_gp is None else [f'The rollout leaves out {residual_gp}.']
