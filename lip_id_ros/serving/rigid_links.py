"""
The posterior mean of rigid links: the recursion of Newton and Euler with the mean parameters.

Outward go the motions of the links and gravity, inward the wrenches, and the mass and first moment
of all that a joint carries (docs/maths.md, sections 6 and 10).

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links import Chain, PARAMETERS
from lip_id_ros.kernels.rigid_links.chain import (
    carried,
    load_place,
    Motion,
    place,
    store_place,
    upward,
    velocity,
    with_joint,
)
from lip_id_ros.kernels.rigid_links.triples import (
    cross,
    dot,
    inward,
    load,
    NOTHING,
    outward,
    plus,
    store,
    times,
    Triple,
)
from lip_id_ros.kernels.rigid_links.wrench import (
    along_joint,
    Body,
    body,
    both,
    inertia_times,
    shifted,
    Wrench,
    wrench,
)
from lip_id_ros.model import TrainedModel

ROTOR = PARAMETERS - 1
TORQUE, FORCE, UP, TRIPLES = 4, 5, 6, 7
"""Where the triples of a link are in working memory, after its place, and how many there are."""


class LinksMean(NamedTuple):
    """
    Posterior mean of rigid links; without any, of a chain of no links.

    Attributes
    ----------
    chain : Chain
    parameters : array, shape (n, 11)

    """

    chain: Chain
    parameters: Array


def links_mean(model: TrainedModel) -> Array:
    """
    Return the posterior mean of a model's links, all in one array.

    A query takes a quarter of a microsecond longer for every array that is handed to it.

    """
    for links, features in zip(model.prior.kernel.links, model.states.links, strict=True):
        places = links.chain.rotations, links.chain.translations
        mean = links.parameters(features, model.alpha)
        return np.concatenate([part.ravel() for part in (*places, mean, links.chain.gravity)])
    return np.zeros(3)


@compiled
def _unpacked(mean: Array, prismatic: BoolArray) -> LinksMean:
    n = (mean.shape[0] - 3) // (12 + PARAMETERS)
    rotations = mean[: 9 * n].reshape(n, 3, 3)
    translations = mean[9 * n : 12 * n].reshape(n, 3)
    parameters = mean[12 * n : -3].reshape(n, PARAMETERS)
    return LinksMean(Chain(rotations, translations, prismatic, mean[-3:]), parameters)


@compiled
def energies_of_links(
    tau: Array,
    gravity: Array,
    mean: Array,
    prismatic: BoolArray,
    work: Array,
    q: Array,
    dq: Array,
    ddq: Array,
) -> tuple[float, float]:
    """
    Return T and V; add the torques of T to `tau`, and those of V to `gravity`.

    Parameters
    ----------
    tau, gravity : arrays, shape (n,)
    mean : array
        As `links_mean` lays it out.
    prismatic : bool array, shape (n,)
    work : array, shape (n, 7, 3)
        Working memory.
    q, dq, ddq : arrays, shape (n,)

    """
    links = _unpacked(mean, prismatic)
    kinetic = _to_tip(links, work, q, dq, ddq)
    return kinetic, _to_base(tau, gravity, links, work, ddq)


@compiled
def _to_tip(links: LinksMean, work: Array, q: Array, dq: Array, ddq: Array) -> float:
    # Sets all of `work`; returns T. The motions leave gravity out.
    chain, p = links
    v, up = NOTHING, upward(chain)
    motion = Motion(NOTHING, NOTHING, NOTHING)
    total = 0.0
    for i in range(p.shape[0]):
        at = place(chain, i, q[i])
        v = velocity(v, motion.angular, at, chain.prismatic[i], dq[i])
        motion = with_joint(carried(motion, at), chain.prismatic[i], dq[i], ddq[i])
        up = outward(at.axes, up)
        total += _kinetic(body(p, i), motion.angular, v) + 0.5 * p[i, ROTOR] * dq[i] ** 2
        own = wrench(body(p, i), motion)
        store_place(work, i, at)
        store(work, i, TORQUE, own.torque)
        store(work, i, FORCE, own.force)
        store(work, i, UP, up)
    return total


@compiled
def _kinetic(own: Body, w: Triple, v: Triple) -> float:
    squares = own.mass * dot(v, v) + dot(w, inertia_times(own, w))
    return 0.5 * squares + dot(v, cross(w, own.moment))


@compiled
def _to_base(tau: Array, gravity: Array, links: LinksMean, work: Array, ddq: Array) -> float:
    # Returns V.
    chain, p = links
    total, mass, moment = Wrench(NOTHING, NOTHING), 0.0, NOTHING
    for i in range(p.shape[0] - 1, -1, -1):
        total = both(total, Wrench(load(work, i, TORQUE), load(work, i, FORCE)))
        own = body(p, i)
        mass, moment = mass + own.mass, plus(moment, own.moment)
        up = load(work, i, UP)
        weight = Wrench(cross(moment, up), times(mass, up))
        tau[i] += along_joint(total, chain.prismatic[i]) + p[i, ROTOR] * ddq[i]
        gravity[i] += along_joint(weight, chain.prismatic[i])
        at = load_place(work, i)
        total = shifted(total, at)
        moment = plus(inward(at.axes, moment), times(mass, at.origin))
    return dot(upward(chain), moment)
