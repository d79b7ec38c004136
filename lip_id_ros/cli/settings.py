"""Which settings hold: those of a file, of the command line, or of the model's own fit."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol

from lip_id_ros.baselines.registry import OURS
from lip_id_ros.evaluation.estimator import Described
from lip_id_ros.settings import Config, override, read_config


class Recorded(Described, Protocol):
    """A model that knows where its data came from."""

    @property
    def provenance(self) -> Mapping[str, Any]:
        """As in its data set."""


SECTIONS = ('recording', 'preprocessing')


def for_fit(args: argparse.Namespace) -> Config:
    """Return the settings of `lip_id fit`: the file's, then those of the command line."""
    chosen = {
        'recording.joints': args.joints,
        'fit.kernel': args.model if args.model in OURS else args.kernel,
        'fit.device': args.device,
        'fit.seed': args.seed,
    }
    return _chosen(args.config, chosen)


def for_data(args: argparse.Namespace) -> Config:
    """Return the settings of `lip_id dataset`."""
    return _chosen(args.config, {'recording.joints': args.joints})


def for_comparison(args: argparse.Namespace) -> Config:
    """Return the settings of `lip_id compare`, the same for all models."""
    return _chosen(args.config, {'recording.joints': args.joints, 'fit.seed': args.seed})


def of_model(model: Recorded, path: str | None) -> Config:
    """
    Return the settings with which recordings are read for a model.

    Parameters
    ----------
    model : Recorded
        Its joints are asked of the recording; where no file is given, all else is as it was for
        the first recording of its fit.
    path : str, optional
        A settings file.

    """
    config = _of_fit(model) if path is None else read_config(path)
    recording = replace(config.recording, joints=model.joint_names, joint_types=model.joint_types)
    return replace(config, recording=recording)


def _of_fit(model: Recorded) -> Config:
    sources = model.provenance.get('sources', [])
    recordings = [source for source in sources if all(name in source for name in SECTIONS)]
    values = {
        f'{section}.{name}': value
        for section in (SECTIONS if recordings else ())
        for name, value in recordings[0][section].items()
    }
    return override(Config(), values, 'the settings of the fit')


def _chosen(path: str | None, chosen: Mapping[str, Any]) -> Config:
    config = Config() if path is None else read_config(path)
    given = {name: value for name, value in chosen.items() if value is not None}
    return override(config, given, 'the command line')
