"""What the node `serve` does with a message: answer safely, or refuse and count."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.runtime.feedforward import Answer, Feedforward
from lip_id_ros.runtime.limits import TorqueLimits
from lip_id_ros.runtime.references import Point, Reason, RefusedError

Array = NDArray[np.float64]
Result = TypeVar('Result')


class Server:
    """
    One model, its limits, and the counts of what was answered and refused.

    Every torque that leaves is finite and within its joint's limit.

    Attributes
    ----------
    enabled : bool
        Whether references are answered.

    """

    def __init__(self) -> None:
        self.enabled = False
        self._model: tuple[Feedforward, TorqueLimits] | None = None
        self._answered = Counter(samples=0, plans=0)
        self._refused: Counter[str] = Counter()

    @property
    def active(self) -> bool:
        """Whether there is a model."""
        return self._model is not None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints of the model, none while there is none."""
        return self._model[0].joint_names if self._model else ()

    @property
    def n_refused(self) -> int:
        """How many messages were refused."""
        return self._refused.total()

    @property
    def summary(self) -> str:
        """The state in a word."""
        if not self.active:
            return 'inactive'
        return 'answering' if self.enabled else 'disabled'

    def use(self, feedforward: Feedforward, limits: TorqueLimits) -> None:
        """Answer with this model from now on."""
        self._model = feedforward, limits

    def release(self) -> None:
        """Forget the model."""
        self._model = None

    def sample(self, names: Sequence[str], points: Sequence[Point]) -> Answer:
        """
        Answer a message of one point.

        Parameters
        ----------
        names : sequence of str
            Its joints.
        points : sequence of Point
            Its one point.

        Returns
        -------
        Answer
            With torques in the model's order.

        Raises
        ------
        RefusedError
            If it cannot be answered; it is counted then.

        """
        return self._counted('samples', lambda: self._sample(names, points))

    def plan(self, names: Sequence[str], points: Sequence[Point]) -> Array:
        """
        Answer a message of any number of points.

        Parameters
        ----------
        names : sequence of str
            Its joints.
        points : sequence of Point
            Its points.

        Returns
        -------
        ndarray, shape (number of points, n)
            Torques [N m or N] in the message's order.

        Raises
        ------
        RefusedError
            If it cannot be answered; it is counted then.

        """
        return self._counted('plans', lambda: self._plan(names, points))

    def status(self) -> dict[str, Any]:
        """Return what was done so far, JSON-able."""
        return {
            'enabled': self.enabled,
            'joint_names': list(self.joint_names),
            'answered': dict(self._answered),
            'limited': self._model[1].limited if self._model else 0,
            'refused': dict(self._refused),
        }

    def _counted(self, kind: str, answer: Callable[[], Result]) -> Result:
        try:
            result = answer()
        except RefusedError as refused:
            self._refused[refused.reason.value] += 1
            raise
        self._answered[kind] += 1
        return result

    def _sample(self, names: Sequence[str], points: Sequence[Point]) -> Answer:
        feedforward, limits = self._ready()
        answer = feedforward.sample(names, points)
        return replace(answer, tau=limits.apply(answer.tau))

    def _plan(self, names: Sequence[str], points: Sequence[Point]) -> Array:
        feedforward, limits = self._ready()
        tau = limits.apply(feedforward.plan(names, points))
        return feedforward.in_message_order(names, tau)

    def _ready(self) -> tuple[Feedforward, TorqueLimits]:
        if self._model is None:
            raise RefusedError(Reason.INACTIVE)
        if not self.enabled:
            raise RefusedError(Reason.DISABLED)
        return self._model
