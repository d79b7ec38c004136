"""Updates of a commissioned model: what `adapt` publishes of an arm as it is now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.signals.joint_states import NANOSECONDS
from lip_id_ros.signals.joints import Refusal, RefusedError

TRUSTED = 'trusted'
"""Name of the first value of a message; the numbers follow."""


@dataclass(frozen=True, eq=False)
class Update:
    """
    An arm as it is now.

    `model`: hash of the commissioned model. `numbers`, shape (11 n + K,): parameters of the links,
    then coefficients of friction; those of the fit, with a known payload, where what was learned
    is not `trusted`. `source`: full name of the node. `stamp_ns`: when it was published, by that
    node's clock [ns].

    """

    model: str
    numbers: Array
    trusted: bool
    source: str = ''
    stamp_ns: int = 0

    @property
    def interface(self) -> tuple[Sequence[str], Array]:
        """Names and values, as a control_msgs/InterfaceValue has them."""
        names = [TRUSTED, *(f'number_{k}' for k in range(self.numbers.size))]
        return names, np.append(float(self.trusted), self.numbers)

    @classmethod
    def from_message(cls, message: Any) -> Update:
        """Read a control_msgs/DynamicInterfaceGroupValues; RefusedError if it is no update."""
        groups, interfaces = message.interface_groups, message.interface_values
        if len(groups) != 1 or len(interfaces) != 1:
            raise RefusedError(Refusal.NO_UPDATE)
        names, values = interfaces[0].interface_names, np.array(interfaces[0].values)
        if list(names[:1]) != [TRUSTED] or len(names) != values.size:
            raise RefusedError(Refusal.NO_UPDATE)
        if not np.isfinite(values).all():
            raise RefusedError(Refusal.NOT_FINITE_UPDATE)
        source, stamp = message.header.frame_id, message.header.stamp
        stamp_ns = NANOSECONDS * stamp.sec + stamp.nanosec
        return cls(groups[0], values[1:], bool(values[0]), source, stamp_ns)
