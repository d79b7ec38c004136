"""The formats that an arm can be exported in."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import partial
import os
from typing import NamedTuple

from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.errors import ModelError
from lip_id_ros.export import mjcf, urdf
from lip_id_ros.export.arm import ArmDescription, Exported
from lip_id_ros.export.c_header import to_c_header
from lip_id_ros.export.mjcf import to_mjcf
from lip_id_ros.export.text import left_out_remark, split_friction
from lip_id_ros.export.urdf import to_urdf
from lip_id_ros.export.urdf_template import noted_template
from lip_id_ros.files import write_whole
from lip_id_ros.rigid_body.couplings import coupling_texts


class Format(NamedTuple):
    """
    A format of other programs.

    `friction`: names of the terms of friction that it can express; None for all.
    """

    text: Callable[[ArmDescription], str]
    friction: Collection[str] | None


HEADER, URDF = 'c', 'urdf'
FORMATS = {
    URDF: Format(to_urdf, urdf.FRICTION),
    'mjcf': Format(to_mjcf, mjcf.FRICTION),
    HEADER: Format(to_c_header, None),
}


@dataclass(frozen=True)
class Formatted:
    """An arm as the text of a file, in the format `name`."""

    name: str
    form: Format
    exported: Exported
    text: str

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file; OSError if that fails."""
        write_whole(path, self.text.encode())

    @property
    def left_out(self) -> list[str]:
        """A sentence on friction that the format cannot express, where there is some."""
        if self.form.friction is None:
            return []
        arm = self.exported.arm
        terms = split_friction(arm, self.form.friction).left_out.basis.terms
        return left_out_remark(arm, terms, self.name)


@dataclass(frozen=True)
class Template:
    """A URDF of the user, of which fitted numbers are replaced, `origins` of joints if asked."""

    description: RobotDescription
    origins: bool

    @property
    def form(self) -> Format:
        """The format that it is."""
        return Format(
            partial(noted_template, description=self.description, origins=self.origins),
            urdf.FRICTION,
        )


def formatted(name: str, exported: Exported, template: Template | None = None) -> Formatted:
    """
    Return an arm in one of `FORMATS`, or in a template.

    LipIdError if a program that the format needs is missing, ModelError if the format cannot have
    the arm.
    """
    form = FORMATS[name]
    if exported.arm.chain.couplings.size and name == URDF:
        arm = exported.arm
        raise ModelError(
            'joints whose reported positions are their own were expected, since URDF knows no '
            f'others, but those of the arm are coupled ({_listed(arm)}); export --mjcf or --c, '
            'which have the coupling.'
        )
    if name == HEADER and exported.residual_gp is not None:
        raise ModelError(
            f'the C header has links and friction only, but the model also has '
            f'{exported.residual_gp}; fit with fit.terms: named, which leaves such processes '
            'out of the fit, or export --urdf or --mjcf, which leave that out.'
        )
    if template is not None:
        form, exported = template.form, replace(exported, arm=exported.in_model_frames)
    return Formatted(name.upper(), form, exported, form.text(exported.arm))


def _listed(arm: ArmDescription) -> str:
    return ', '.join(coupling_texts(arm.chain, arm.joint_names))
