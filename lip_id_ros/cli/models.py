"""What the verbs ask of a model, of this package or of the literature."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any, Protocol

from rich.console import Console

from lip_id_ros.baselines.learned import learn as learn_other
from lip_id_ros.baselines.learned import Learned
from lip_id_ros.baselines.registry import OURS
from lip_id_ros.cli import show
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError
from lip_id_ros.evaluation import Evaluation, judged, run, score, with_inertia_check
from lip_id_ros.evaluation.cautions import of_fit
from lip_id_ros.evaluation.prediction_file import estimates, Values
from lip_id_ros.evaluation.report import band, write_report
from lip_id_ros.evaluation.training_data import same_recording, warnings
from lip_id_ros.gp import fit
from lip_id_ros.model import TrainedModel
from lip_id_ros.model.checked_file import COMPARED, schema_of
from lip_id_ros.progress import Progress
from lip_id_ros.serving import Predictor
from lip_id_ros.settings import FitSettings


class Model(Protocol):
    """A model, as the verbs use it."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints from base to tip."""

    @property
    def joint_types(self) -> tuple[str, ...]:
        """Revolute or prismatic, per joint."""

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Where the data came from."""

    def save(self, path: str) -> None:
        """Write it into one file."""

    def evaluate(self, dataset: Dataset, progress: Progress) -> Evaluation:
        """Compare it with a data set of its joints."""

    def report(self, args: argparse.Namespace, dataset: Dataset, progress: Progress) -> Evaluation:
        """Compare it with a data set, and draw that into the folder `args.report`."""

    def values(self, dataset: Dataset, progress: Progress) -> Values:
        """Return what it says along a data set, as for a prediction file."""

    def warnings(self, dataset: Dataset) -> list[str]:
        """Say so where a data set is, or may be, what it was fitted on."""

    def described(self) -> dict[str, Any]:
        """Return what it is, as JSON knows it."""

    def show(self, training: Dataset, console: Console) -> None:
        """Show what the fit found."""

    def cautions(self) -> list[str]:
        """Say what was unusual about the fit."""


def learn(
    args: argparse.Namespace, training: Dataset, settings: FitSettings, progress: Progress
) -> Model:
    """Fit the model that `args.model` names, one of this package by default."""
    if args.model is None or args.model in OURS:
        return OfThisPackage(with_inertia_check(fit(training, settings, progress)))
    return OfTheLiterature(learn_other(args.model, training, settings, args.urdf, progress))


def load(path: str) -> Model:
    """
    Read a model of either kind.

    Raises
    ------
    OSError
        If the file does not exist or cannot be opened.
    ModelError
        If it is damaged or no model.

    """
    if schema_of(path) == COMPARED:
        return OfTheLiterature(Learned.load(path))
    return OfThisPackage(TrainedModel.load(path))


class OfThisPackage:
    """A model with all that a `Predictor` can tell."""

    def __init__(self, model: TrainedModel) -> None:
        self._model = model
        self.joint_names, self.joint_types = model.joint_names, model.joint_types
        self.provenance, self.save = model.provenance, model.save

    def evaluate(self, dataset: Dataset, progress: Progress) -> Evaluation:
        """Compare torques, energies and inertia matrices."""
        return score(run(Predictor(self._model), dataset, progress))

    def report(self, args: argparse.Namespace, dataset: Dataset, progress: Progress) -> Evaluation:
        """Draw torques, errors and energies."""
        model, predictor = self._model, Predictor(self._model)
        outcome = run(predictor, dataset, progress)
        evaluation = score(outcome)
        uncertainty = band(predictor, outcome, model.noise_std, progress)
        labels = show.labels(args, model, self.warnings(dataset))
        write_report(args.report, outcome, evaluation, uncertainty, labels, progress)
        return evaluation

    def values(self, dataset: Dataset, progress: Progress) -> Values:
        """Return all of a prediction, with standard deviations."""
        predictor = Predictor(self._model)
        return estimates(predictor, run(predictor, dataset, progress), progress)

    def warnings(self, dataset: Dataset) -> list[str]:
        """Look for the samples of the fit, then for its recordings."""
        return warnings(self._model, dataset)

    def described(self) -> dict[str, Any]:
        """Return kernel, joints and fit."""
        model = self._model
        return {
            'kernel': model.kernel,
            'joints': list(model.joint_names),
            'joint_types': list(model.joint_types),
            'samples': model.n_samples,
            'has_potential_energy': model.has_potential,
            **_links(model),
            'fit': dict(model.summary),
            'provenance': dict(model.provenance),
        }

    def show(self, training: Dataset, console: Console) -> None:
        """Show joints and noise."""
        show.fitted(self._model, training, console)

    def cautions(self) -> list[str]:
        """Say what the summary tells."""
        return of_fit(self._model.summary)


def _links(model: TrainedModel) -> dict[str, Any]:
    kernel = model.prior.kernel
    if not kernel.links:
        return {}
    axes = {
        joint: {'angle_deg': angle, 'distance_m': distance}
        for joint, angle, distance in show.axes(model)
    }
    return {'energies_beside_links': kernel.energy.name, 'axis_to_the_one_before': axes}


class OfTheLiterature:
    """A model that knows torques, perhaps energies, and nothing of its uncertainty."""

    def __init__(self, learned: Learned) -> None:
        self._learned = learned
        self.joint_names, self.joint_types = learned.joint_names, learned.joint_types
        self.provenance, self.save = learned.provenance, learned.save

    def evaluate(self, dataset: Dataset, progress: Progress) -> Evaluation:
        """Compare torques, and energies where it has them."""
        answer = self._learned.predict(dataset.q, dataset.dq, dataset.ddq)
        return judged(dataset, answer.tau, answer.kinetic, answer.potential)

    def report(self, args: argparse.Namespace, dataset: Dataset, progress: Progress) -> Evaluation:
        """Refuse: there are neither parts of the torque nor standard deviations to draw."""
        raise ConfigError(
            f'the page of --report is drawn of models of this package, but {args.model} is of the '
            f'kind {self._learned.method!r}; leave --report out, or let lip_id compare draw it '
            'beside others.'
        )

    def values(self, dataset: Dataset, progress: Progress) -> Values:
        """Return torques, and energies where it has them."""
        return dict(vars(self._learned.predict(dataset.q, dataset.dq, dataset.ddq)))

    def warnings(self, dataset: Dataset) -> list[str]:
        """Look for the recordings of the fit."""
        return same_recording(self.provenance, dataset)

    def described(self) -> dict[str, Any]:
        """Return method, joints and size."""
        learned = self._learned
        return {
            'model': learned.method,
            'joints': list(learned.joint_names),
            'joint_types': list(learned.joint_types),
            'samples': learned.n_samples,
            'numbers_kept': learned.estimator.size,
            'fit': {'seconds_total': learned.fit_seconds},
            'provenance': dict(learned.provenance),
        }

    def show(self, training: Dataset, console: Console) -> None:
        """Show size and time."""
        learned = self._learned
        text = (
            f'{learned.method}: {len(learned.joint_names)} joints, {learned.n_samples} samples, '
            f'fitted in {learned.fit_seconds:.3g} s; {learned.estimator.size} numbers are kept.'
        )
        show.sentences([text], console)

    def cautions(self) -> list[str]:
        """Say nothing: these fits tell nothing of themselves."""
        return []
