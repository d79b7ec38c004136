"""Settings of nodes that follow updates, and the rules that follow for a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lip_id_ros.arrays import Array
from lip_id_ros.settings import setting
from lip_id_ros.settings.settings import PER_JOINT
from lip_id_ros.signals.joints import by_joint


@dataclass(frozen=True, eq=False)
class FollowRules:
    """
    How updates are followed.

    `blend_s`: time from the torques before to those of an update [s]. `timeout_s`: age beyond
    which none is followed. `limits`, shape (n,): largest change of a torque, in the largest of the
    training data. `follows`: whether updates are followed at all.

    """

    blend_s: float
    timeout_s: float
    limits: Array
    follows: bool = True


FOLLOWING: dict[str, tuple[Any, str, dict[str, Any]]] = {
    'follow_adaptation': (False, 'Follow the updates of the model that adapt publishes.', {}),
    'blend_s': (
        2.0,
        'Time in which torques go over to an update, or back to the commissioned model.',
        {'unit': 's', 'minimum': 0.0, 'maximum': 60.0},
    ),
    'adaptation_timeout_s': (
        5.0,
        'Age beyond which an update is not followed, and the commissioned model comes back.',
        {'unit': 's', 'minimum': 0.1},
    ),
    'adaptation_limit': (
        (2.0,),
        'Largest change of a torque by an update, at the states of the training data, in the '
        f'largest torque of the joint there; updates beyond are refused. {PER_JOINT}',
        {'minimum': 0.0},
    ),
}
"""Default, description and bounds of each setting."""


def follow_setting(name: str, applies: str, more: str = '') -> Any:
    """Declare one of `FOLLOWING`, with more to say of it."""
    default, description, bounds = FOLLOWING[name]
    return setting(default, description + more, applies=applies, **bounds)


def follow_rules(settings: Any, joint_names: Sequence[str]) -> FollowRules:
    """Bring the settings above into the order of a model's joints; ConfigError if they misfit."""
    limits = by_joint(
        'adaptation_limit', settings.adaptation_limit, settings.joints, joint_names, 1.0
    )
    return FollowRules(
        settings.blend_s, settings.adaptation_timeout_s, limits, settings.follow_adaptation
    )
