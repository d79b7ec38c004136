"""Load a model file for serving, or refuse it with a sentence."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.adaptation.adapted_model import AdaptedModel
from lip_id_ros.adaptation.follow_settings import follow_rules
from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError, LipIdError, ModelError
from lip_id_ros.feedforward.settings import make_rules, require_consistent, ServeSettings
from lip_id_ros.files import require_regular_file
from lip_id_ros.friction.dahl_friction import RunningMemory
from lip_id_ros.model import DynamicsModel, EffortCalibration, InverseDynamicsModel, Query
from lip_id_ros.model.known_states import KnownStates
from lip_id_ros.model.proof import missing_proof
from lip_id_ros.model.serialization import contradictions
from lip_id_ros.signals.joints import require_joints


@dataclass(frozen=True, eq=False)
class LoadedModel:
    """
    A model, ready to be served.

    `model` has friction as drives have it; `rise_time` is that of the model that was fitted [s].
    `calibration`: of the effort that it was fitted to. `known_states`: that it was fitted to.
    `memory`: of friction. `adapted`: what updates make of the model, where they are followed.
    """

    model: DynamicsModel
    calibration: EffortCalibration
    known_states: KnownStates | None = None
    memory: RunningMemory | None = None
    adapted: AdaptedModel | None = None
    rise_time: float = 0.0

    @property
    def newest(self) -> DynamicsModel:
        """The model as it is now."""
        return self.model if self.adapted is None else self.adapted.newest

    def query(self, state: Array, now: float) -> Query:
        """Evaluate a state (3, n) of a stream at a time [s]."""
        if self.adapted is not None:
            return self.adapted.query(state, now)
        found = self.model.query(*state)
        if self.memory is None:
            return found
        return found._replace(tau=found.tau + self.memory.torque(state, now))

    def still(self, state: Array, now: float) -> Query:
        """Evaluate a state that belongs to no stream."""
        if self.adapted is not None:
            return self.adapted.query(state, now, is_stream=False)
        return self.model.query(*state)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints from base to tip."""
        return self.model.joint_names


def load_model(settings: ServeSettings, joints: Sequence[str]) -> LoadedModel:
    """
    Load a model and let it answer, so that what is compiled on first use is compiled now.

    `joints`: that it must have, in any order; empty for any. LipIdError if it is not a model, its
    joints are not those expected, or it is not proven.
    """
    require_regular_file(settings.model_path)
    fitted = _loaded(settings.model_path)
    require_joints(fitted.joint_names, joints, settings.model_path)
    if not settings.accept_unproven:
        require_proof(fitted, settings.model_path)
    model = fitted.with_rise_time(0.0)
    rest = np.zeros((1, model.n_joints))
    model.query(rest[0], rest[0], rest[0])
    model.predict(rest, rest, rest)
    if settings.publish_std:
        model.standard_deviation(rest, rest, rest)
    adapted = None
    if settings.follow_adaptation:
        adapted = AdaptedModel(fitted, follow_rules(settings, model.joint_names))
    return LoadedModel(
        model,
        model.effort_calibration,
        model.known_states,
        model.running_memory(),
        adapted,
        fitted.rise_time,
    )


def _loaded(path: str) -> InverseDynamicsModel:
    try:
        return InverseDynamicsModel.load(path)
    except (LipIdError, OSError):
        raise
    except Exception as error:  # whatever it is: a reload keeps the old model
        raise ModelError(
            f'{path} must be a model that can be loaded here, but {type(error).__name__} came '
            f'({error}); free memory, or fit again.'
        ) from error


def require_proof(model: InverseDynamicsModel, path: str) -> None:
    """Refuse a model that is not proven; ModelError says what it lacks."""
    with contradictions(path):
        lack = missing_proof(model)
    if lack is not None:
        raise ModelError(
            f'{path} must be a model that is proven on unseen motion, but {lack}, or set '
            'accept_unproven to true where nobody can be hurt.'
        )


def load_successor(settings: ServeSettings, before: LoadedModel) -> LoadedModel:
    """
    Load a model that takes the place of another; LipIdError if its joints stand in another order.

    Then lists of parameters and torques without names would change their meaning.
    """
    expected = before.joint_names
    loaded = load_model(settings, expected)
    found = loaded.joint_names
    if found == expected:
        return loaded
    raise ModelError(
        f'{settings.model_path} must have its joints in the order {", ".join(expected)}, but has '
        f'{", ".join(found)}; clean the node up and configure it anew to change the order.'
    )


def load_models(settings: ServeSettings, before: LoadedModel | None) -> dict[str, LoadedModel]:
    """
    Load the model of `model_path`, under an empty name, and those with payloads, by their paths.

    `before`: the model whose place they take. LipIdError if one is not a model, or has other
    joints, or no payload has the name that is set.
    """
    require_consistent(settings)
    require_payload(settings, settings.payload_models)
    if before is None:
        models = {'': load_model(settings, settings.joints)}
    else:
        models = {'': load_successor(settings, before)}
    for path in dict.fromkeys(settings.payload_models):
        models[path] = load_successor(replace(settings, model_path=path), models[''])
    return models


def require_payload(settings: ServeSettings, known: Collection[str]) -> None:
    """Refuse a payload that is not loaded; ConfigError with the names that are."""
    if settings.payload and settings.payload not in known:
        listed = ', '.join(filter(None, known)) or 'none'
        raise ConfigError(
            f'payload must be one of the payload_models that are loaded ({listed}), but is '
            f'{settings.payload}; name it there, and call reload_model or configure the node.'
        )


def require_rules(settings: ServeSettings, loaded: LoadedModel | None) -> None:
    """Raise ConfigError for settings that do not fit the arm, its model or named joints."""
    joints = loaded.joint_names if loaded else settings.joints
    if joints:
        make_rules(settings, joints)
    else:
        require_consistent(settings)
    if loaded and settings.follow_adaptation and loaded.adapted is None:
        raise ConfigError(
            'follow_adaptation must be true when the model is loaded, but was false then; clean '
            'the node up, set it, and configure the node anew.'
        )
    if loaded and settings.gravity and not loaded.model.has_potential:
        raise ConfigError(
            'gravity is true, but the model has none, since the efforts of its fit were '
            'gravity-compensated; set gravity to false where the robot adds its own, or fit '
            'efforts with gravity.'
        )
