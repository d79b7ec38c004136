"""Updates of a commissioned model: what `adapt` publishes, as one line of JSON."""

from __future__ import annotations

from dataclasses import dataclass
import json

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.signals.joints import Refusal, RefusedError

SCHEMA = 'lip_id_ros/update'

MOST_BYTES = 100_000
"""Longer than an update of any arm."""


@dataclass(frozen=True, eq=False)
class Update:
    """
    An arm as it is now.

    `model`: hash of the commissioned model. `counter`: higher than that of the update before.
    `numbers`, shape (11 n + K,): parameters of the links, then coefficients of friction; those of
    the fit, with a known payload, where what was learned is not `trusted`. `errors`: recent mean
    squares of measured torques about those expected and those of the fit, in their variances.

    """

    model: str
    counter: int
    numbers: Array
    trusted: bool
    errors: tuple[float, float]

    @property
    def is_worse(self) -> bool:
        """Whether what was learned is not better than the fit, by the update itself."""
        learned, fitted = self.errors
        return self.trusted and not learned <= fitted

    def to_text(self) -> str:
        """Return one line of JSON; numbers read back exactly."""
        return json.dumps(
            {
                'schema': SCHEMA,
                'model': self.model,
                'counter': self.counter,
                'trusted': self.trusted,
                'errors': list(self.errors),
                'numbers': self.numbers.tolist(),
            }
        )

    @classmethod
    def from_text(cls, text: str) -> Update:
        """Read an update; RefusedError if it is none, or its numbers are not finite."""
        if len(text) > MOST_BYTES:
            raise RefusedError(Refusal.NO_UPDATE)
        try:
            found = json.loads(text)
            numbers = np.array(found['numbers'], dtype=np.float64)
            errors = float(found['errors'][0]), float(found['errors'][1])
            counter, trusted = found['counter'], found['trusted']
            is_update = (
                found['schema'] == SCHEMA
                and numbers.ndim == 1
                and type(counter) is int
                and type(trusted) is bool
            )
            update = cls(str(found['model']), counter, numbers, trusted, errors)
        except (ValueError, TypeError, KeyError, IndexError, OverflowError, RecursionError):
            raise RefusedError(Refusal.NO_UPDATE) from None
        if not is_update:
            raise RefusedError(Refusal.NO_UPDATE)
        if not np.isfinite(numbers).all() or not np.isfinite(errors).all():
            raise RefusedError(Refusal.NOT_FINITE_UPDATE)
        return update
