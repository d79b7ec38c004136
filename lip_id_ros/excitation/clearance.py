"""
Links that keep a distance from each other, from the floor and from boxes, at every time.

Distances are those of coal. From one time to the next that is looked at, no two shapes approach by
more than what they are apart beyond their distance: they move no faster relative to each other
than the sum over the joints between them of their speed times the length of the arm beyond.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import FourierMotion, peaks
from lip_id_ros.excitation.settings import BASE, NONE, SpaceSettings
from lip_id_ros.excitation.shapes import (
    chain_shapes,
    described_shapes,
    FLOOR,
    outline,
    Shapes,
    surroundings,
)
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body.couplings import coupling_matrix

COARSE_HZ, SHOWN_HZ = 10.0, 50.0

SURE = 0.9
"""Distances at the times that are looked at are larger than those that hold at every time."""

DRAWS, TOUCHING = 300, 0.002
"""Random positions; links that are this near at all of them are built to touch [m]."""

NEAR, NEAR_FLOOR = 0.5, 0.8
"""What is always near keeps this share of the most that it is apart there."""

ROOM_M, INNER = 0.15, 0.6
"""A posture has room around it with so much beyond every distance, in this share of the ranges."""


class Extremes(NamedTuple):
    """
    How far a motion goes: a link, and its place [m].

    `lowest`: height above the base plane. `farthest`: distance from the base.
    """

    lowest: tuple[str, float]
    farthest: tuple[str, float]


class Clearance:
    """
    The shapes of an arm, and the distances that they keep.

    `matrix`, shape (n, n): joints move by it times the reported positions.
    """

    def __init__(
        self, shapes: Shapes, limits: JointLimits, matrix: Array, space: SpaceSettings
    ) -> None:
        self.shapes, self._matrix, self._space = shapes, matrix, space
        self._pin, self._model, self._geometry = shapes.pin, shapes.model, shapes.geometry
        self._data = self._model.createData()
        joints = [self._model.joints[each] for each in shapes.joints]
        self._places = [(each.idx_q, each.nq) for each in joints]
        farthest = np.abs(matrix) @ np.maximum(np.abs(limits.lower), np.abs(limits.upper))
        self._beyond = self._lengths(farthest)
        self._links = len(self._geometry.geometryObjects)
        self._around = surroundings(shapes, space)
        self._choose_pairs(limits)

    @property
    def settings(self) -> str:
        """What the distances are from."""
        return 'the section space'

    def distances(self, q: Array, pairs: IndexArray | None = None) -> Array:
        """Return how far pairs, or all, are apart at reported positions (n,) [m]."""
        self._place(q)
        numbers = range(len(self._least)) if pairs is None else pairs.tolist()
        found = [self._pin.computeDistance(self._geometry, self._found, k) for k in numbers]
        return np.array([each.min_distance for each in found])

    def approach(self, speeds: Array) -> Array:
        """Return how fast each pair approaches at most, by speeds of reported positions (n,)."""
        return np.asarray(self._speeds @ speeds)

    def require_posture(self, posture: Array) -> None:
        """Refuse a posture at which something is too near, by a ConfigError that names it."""
        distances = self.distances(posture)
        lacking = self._required - distances
        if lacking.size and lacking.max() > 0.0:
            worst = int(np.argmax(lacking))
            remedy = 'a smaller space.self_distance_m'
            if self._pair(worst)[1] >= self._links:
                remedy = 'correct the section space of the settings'
            raise ConfigError(
                f'{" and ".join(self._names(worst))} must be {self._required[worst]:.2g} m apart '
                f'at the posture, but are {distances[worst]:.2g} m; choose another posture, or '
                f'{remedy}.'
            )

    def is_kept(self, motion: FourierMotion, fine: bool) -> bool:
        """Whether a motion keeps the distances: at every time, or, if not `fine`, at some."""
        curving = self.approach(peaks(motion)[2])
        return (self._is_always_kept if fine else self._is_often_kept)(motion, curving)

    def _is_always_kept(self, motion: FourierMotion, curving: Array) -> bool:
        due, end = np.zeros(len(self._least)), motion.duration
        while (t := float(due.min(initial=end))) < end:
            q, dq = (motion.derivative(np.array([t]), order)[0] for order in (0, 1))
            pairs = np.flatnonzero(due <= t)
            sure = self._sure_for(q, dq, pairs, curving)
            if sure is None:
                return False
            due[pairs] += sure
        return True

    def _is_often_kept(self, motion: FourierMotion, curving: Array) -> bool:
        t, due = motion.times(COARSE_HZ), np.zeros(len(self._least), dtype=np.int64)
        for step, (q, dq) in enumerate(zip(*motion.sample(t)[:2], strict=True)):
            pairs = np.flatnonzero(due <= step)
            if not pairs.size:
                continue
            sure = self._sure_for(q, dq, pairs, curving)
            if sure is None:
                return False
            due[pairs] = step + np.clip(sure * COARSE_HZ, 1.0, len(t)).astype(np.int64)
        return True

    def _sure_for(self, q: Array, dq: Array, pairs: IndexArray, curving: Array) -> Array | None:
        """Return for how long pairs surely keep their distances [s]; None if one is too near."""
        distances = self.distances(q, pairs)
        if np.any(distances < self._required[pairs]):
            return None
        speeds = self._speeds[pairs] @ np.abs(dq)
        return _time_to(distances - self._least[pairs], speeds, curving[pairs])

    def clear_posture(self, middle: Array, limits: JointLimits) -> Array:
        """Return the posture nearest to the middle that has room around it, shape (n,)."""
        rng, half = np.random.default_rng(0), 0.5 * (limits.upper - limits.lower)
        around = rng.uniform(-INNER, INNER, (DRAWS, len(middle))) * half
        postures = np.concatenate([middle[None], middle + around])
        enough = np.minimum(ROOM_M, NEAR * (self._most - self._required))
        enough = np.maximum(enough, 1e-9)
        room = [
            np.min((self.distances(q) - self._required) / enough, initial=1.0) for q in postures
        ]
        away = np.linalg.norm((postures - middle) / half, axis=1)
        best = max(range(len(postures)), key=lambda k: (room[k], -away[k]))
        return np.asarray(postures[best])

    def extremes(self, motion: FourierMotion) -> Extremes:
        """Return the lowest and the farthest point of a motion, of all links but the first."""
        q = motion.derivative(motion.times(SHOWN_HZ), 0)
        objects = self._geometry.geometryObjects
        fixed = 0, self.shapes.joints[0]  # the first link stays as low as it is
        moving = [k for k in range(self._links) if objects[k].parentJoint not in fixed]
        outlines = {k: outline(objects[k].geometry) for k in moving}
        low, far = dict.fromkeys(moving, np.inf), dict.fromkeys(moving, 0.0)
        for row in q:
            self._place(row)
            for k, (points, radius) in outlines.items():
                place = self._found.oMg[k]
                at = points @ place.rotation.T + place.translation - self.shapes.base
                low[k] = min(low[k], float(at[:, 2].min()) - radius)
                far[k] = max(far[k], float(np.linalg.norm(at, axis=1).max()) + radius)
        lowest, farthest = min(moving, key=low.__getitem__), max(moving, key=far.__getitem__)
        return Extremes(
            (self.shapes.link(lowest), low[lowest]), (self.shapes.link(farthest), far[farthest])
        )

    def _place(self, q: Array) -> None:
        position = self._pin.neutral(self._model)
        for (at, size), value in zip(self._places, self._matrix @ q, strict=True):
            position[at : at + size] = value if size == 1 else (np.cos(value), np.sin(value))
        self._pin.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._found, position
        )

    def _lengths(self, farthest: Array) -> Array:
        """Return how far each joint is from the one before at most, in pinocchio's order [m]."""
        lengths = np.array(
            [np.linalg.norm(each.translation) for each in self._model.jointPlacements]
        )
        for number, most in zip(self.shapes.joints, farthest, strict=True):
            if 'P' in self._model.joints[number].shortname():
                lengths[number] += most
        return lengths

    def _choose_pairs(self, limits: JointLimits) -> None:
        """Look at all pairs but neighbours, and those that are built to touch."""
        self._geometry.removeAllCollisionPairs()
        for a, b in self._candidates():
            self._geometry.addCollisionPair(self._pin.CollisionPair(a, b))
        count = len(self._geometry.collisionPairs)
        self._found, self._least = self._geometry.createData(), np.zeros(count)
        rng = np.random.default_rng(0)
        draws = rng.uniform(limits.lower, limits.upper, (DRAWS, limits.lower.size))
        most = np.max([self.distances(q) for q in draws], axis=0, initial=0.0)
        least = np.array([self._distance(k, most[k]) for k in range(count)])
        for pair in np.flatnonzero(least == 0.0)[::-1]:
            self._geometry.removeCollisionPair(self._geometry.collisionPairs[int(pair)])
        self._most, self._least = most[least > 0.0], least[least > 0.0]
        self._required = self._least / SURE
        self._found = self._geometry.createData()
        speeds = [self._speed(k) for k in range(len(self._least))]
        self._speeds = np.reshape(speeds, (len(self._least), len(self._places)))

    def _candidates(self) -> list[tuple[int, int]]:
        parents = [each.parentJoint for each in self._geometry.geometryObjects]
        pairs = [(a, b) for b in self._around for a in range(self._links) if parents[a] > 0]
        if self._space.self_distance_m == NONE:
            return pairs
        for b in range(self._links):
            for a in range(b):
                low, high = sorted((parents[a], parents[b]))
                if low != high and self._model.parents[high] != low:
                    pairs.append((a, b))
        return pairs

    def _distance(self, pair: int, most: float) -> float:
        """Return the distance that a pair keeps, which is `most` apart at random; 0 for none."""
        a, b = self._pair(pair)
        if b < self._links:
            wanted = float(self._space.self_distance_m)
            return 0.0 if most <= TOUCHING else min(wanted, NEAR * most)
        if self._geometry.geometryObjects[b].name != FLOOR or most <= TOUCHING:
            # the first link may stand in the floor; all else that always does is an error
            stands = self._geometry.geometryObjects[b].name == FLOOR and self._is_first(a)
            return 0.0 if stands else self._space.margin_m
        return min(self._space.margin_m, NEAR_FLOOR * most)

    def _is_first(self, number: int) -> bool:
        return self._parent(number) == self.shapes.joints[0]

    def _speed(self, pair: int) -> Array:
        """Return how fast two shapes approach at most by each reported unit speed, (n,)."""
        first, last = sorted(self._pair(pair), key=self._parent)
        shape = self._geometry.geometryObjects[last]
        points, radius = outline(shape.geometry)
        own = points @ shape.placement.rotation.T + shape.placement.translation
        reach = float(np.linalg.norm(own, axis=1).max()) + radius
        near, joint, by_joint = (
            self._parent(first),
            self._parent(last),
            np.zeros(self._model.njoints),
        )
        while joint != near and joint != 0:
            slides = 'P' in self._model.joints[joint].shortname()
            by_joint[joint] = 1.0 if slides else reach
            reach += self._beyond[joint]
            joint = self._model.parents[joint]
        return np.asarray(by_joint[list(self.shapes.joints)] @ np.abs(self._matrix))

    def _pair(self, pair: int) -> tuple[int, int]:
        found = self._geometry.collisionPairs[pair]
        return found.first, found.second

    def _parent(self, number: int) -> int:
        return int(self._geometry.geometryObjects[number].parentJoint)

    def _names(self, pair: int) -> tuple[str, str]:
        a, b = self._pair(pair)
        return self.shapes.link(a), self.shapes.link(b)


def clearance_of(
    space: SpaceSettings,
    description: RobotDescription | None,
    limits: JointLimits,
    model: InverseDynamicsModel | None,
) -> tuple[Clearance | None, str]:
    """
    Return the links of a URDF, or of a model that was fitted with one, and what is not checked.

    None where the base is not known; ConfigError if a floor or boxes are asked for there.
    """
    off = [WHAT[0]] * (space.floor_m == NONE) + [WHAT[1]] * (space.self_distance_m == NONE)
    named = bool(space.boxes or space.keep_in)
    matrix = np.eye(len(limits.joint_names))
    if model is not None and model.arm is not None:
        matrix = coupling_matrix(model.arm.chain)
    if description is not None:
        shapes = described_shapes(description, space)
    elif model is not None and model.arm is not None and 'description' in model.summary:
        shapes = chain_shapes(model.arm.chain, limits.joint_names, space)
    elif named or space.floor_m not in (BASE, NONE):
        raise ConfigError(
            'a floor in numbers, boxes or space.keep_in need a URDF, or a model that was fitted '
            'with one: torques do not show how high the base is, how it is turned, nor where on '
            'its axis a joint is; give a URDF, or leave them out.'
        )
    else:
        return None, f'Nobody has checked {" and ".join(WHAT)}: no URDF says where the links are.'
    sentences = [f'Nobody has checked {" and ".join(off)}: the settings say so.'] * bool(off)
    found = Clearance(shapes, limits, matrix, space)
    return found, ' '.join([*sentences, *filter(None, [shapes.note])])


WHAT = 'the floor', 'self-collision'


def _time_to(distances: Array, speeds: Array, accelerations: Array) -> Array:
    """Return the least times in which so much speed, and so much more a second, goes so far."""
    root = np.sqrt(speeds**2 + 2.0 * accelerations * distances)
    return np.asarray(2.0 * distances / np.maximum(speeds + root, 1e-12))
