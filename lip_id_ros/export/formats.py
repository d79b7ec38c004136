"""The formats that an arm can be exported in: how each is written and checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import os
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.c_header import to_c_header
from lip_id_ros.export.check import Agreement, check_c_header, check_mjcf, check_urdf
from lip_id_ros.export.from_model import Exported
from lip_id_ros.export.mjcf import to_mjcf
from lip_id_ros.export.urdf import to_urdf
from lip_id_ros.files import write_whole
from lip_id_ros.model import DynamicsModel


class Format(NamedTuple):
    """
    A format of other programs.

    Attributes
    ----------
    text : callable
        Writes an arm.
    check : callable
        Evaluates what was written.
    consistent : bool
        Whether readers refuse links that cannot exist.

    """

    text: Callable[[ArmDescription], str]
    check: Callable[[str, ArmDescription, Array, Array], Agreement]
    consistent: bool


FORMATS = {
    'urdf': Format(to_urdf, check_urdf, True),
    'mjcf': Format(to_mjcf, check_mjcf, True),
    'c': Format(to_c_header, check_c_header, False),
}


@dataclass(frozen=True)
class Written:
    """
    An arm that has been written.

    Attributes
    ----------
    form : Format
    arm : ArmDescription
        As it was written.
    exported : Exported
        As it came from the model.
    text : str

    """

    form: Format
    arm: ArmDescription
    exported: Exported
    text: str

    @property
    def warnings(self) -> list[str]:
        """What was changed or left out on the way."""
        changed = [x for x in self.arm.remarks if x not in self.exported.arm.remarks]
        remainder = self.exported.remainder
        return changed + ([] if remainder is None else [f'Left out: {remainder}.'])

    def check(self, model: DynamicsModel, count: int) -> Agreement:
        """
        Compare what others read with the model, at random states in the range of the recordings.

        Where the model has more than links and friction, or its links cannot exist, what was
        written is compared with itself as evaluated here.

        """
        states = self.arm.ranges.random_states(count, np.random.default_rng(0))
        tau = model.predict(*states).tau if self.is_whole else self.arm.torque(*states)
        return self.form.check(self.text, self.arm, tau, states)

    @property
    def is_whole(self) -> bool:
        """Whether the torques are those of the model: nothing was changed or left out."""
        return self.exported.remainder is None and self.arm.remarks == self.exported.arm.remarks


def write(name: str, path: str | os.PathLike[str], exported: Exported) -> Written:
    """
    Write an arm in one of `FORMATS`.

    Raises
    ------
    LipIdError
        If a program that the format needs is missing.
    ModelError
        If the format cannot have the arm.
    OSError
        If the file cannot be written.

    """
    form, arm = FORMATS[name], exported.arm
    if form.consistent:
        arm = arm.with_consistent_links()
    elif exported.remainder is not None:
        raise ModelError(
            f'the C header has links and friction only, but the model also has '
            f'{exported.remainder}; fit with more data, or export --urdf or --mjcf, which leave '
            'that out.'
        )
    text = form.text(arm)
    write_whole(path, text.encode())
    return Written(form, arm, exported, text)
