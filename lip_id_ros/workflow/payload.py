"""From recordings of an arm with a payload to the payload, and what is to be known about it."""

from __future__ import annotations

from dataclasses import dataclass

from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import data_remarks, evaluate, evaluation_cautions
from lip_id_ros.export.payload import (
    attached,
    mass_cautions,
    payload_in_flange,
    residual_gp_cautions,
)
from lip_id_ros.identification.payload import identify_payload, Payload
from lip_id_ros.model import InverseDynamicsModel


@dataclass(frozen=True, eq=False)
class FoundPayload:
    """A payload in the robot's flange, the model of the arm with it, and cautions in sentences."""

    payload: Payload
    model: InverseDynamicsModel
    cautions: list[str]


def find_payload(
    model: InverseDynamicsModel, data: Dataset, flange: tuple[float, float] = (0.0, 0.0)
) -> FoundPayload:
    """
    Identify the payload of an arm whose model is known.

    `data`: of the arm with its payload, with the model's joints in its order. `flange`: its frame
    in that of the last link, as `payload_in_flange` takes it. DataError and FitError as from
    `identify_payload`.
    """
    found = identify_payload(model, data)
    shown, loaded = payload_in_flange(found, *flange), attached(model, found)
    cautions = [
        *data_remarks(data.provenance),
        *mass_cautions(shown),
        *residual_gp_cautions(model),
        *evaluation_cautions(evaluate(loaded, data)),
    ]
    return FoundPayload(shown, loaded, cautions)
