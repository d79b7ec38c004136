"""Random serial arms of rigid bodies: forward kinematics and Jacobians, nothing else."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array


def rotation(rng: np.random.Generator) -> Array:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diagonal(r))
    return q if np.linalg.det(q) > 0.0 else -q


def about_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


class SerialArm:
    """An arm whose joints turn about, or slide along, the z axes of frames placed at random."""

    def __init__(self, types: tuple[str, ...], seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self.types = types
        self.turns = [rotation(rng) for _ in types]
        self.shifts = rng.normal(size=(len(types), 3))
        self.masses = 0.5 + rng.random(len(types))
        self.centres = rng.normal(size=(len(types), 3))
        halves = rng.normal(size=(len(types), 3, 3))
        self.inertias = halves @ halves.transpose(0, 2, 1)

    def frames(self, q: Array) -> list[tuple[Array, Array, Array, Array]]:
        turn, origin = np.eye(3), np.zeros(3)
        found = []
        for i, kind in enumerate(self.types):
            origin = origin + turn @ self.shifts[i]
            turn = turn @ self.turns[i]
            axis = turn[:, 2]
            if kind == 'revolute':
                turn = turn @ about_z(q[i])
            else:
                origin = origin + q[i] * axis
            found.append((axis, origin, turn, origin + turn @ self.centres[i]))
        return found

    def link_inertia(self, link: int, q: Array) -> Array:
        frames = self.frames(q)
        _, _, turn, centre = frames[link]
        linear, angular = np.zeros((2, 3, len(q)))
        for b in range(link + 1):
            axis, origin, _, _ = frames[b]
            if self.types[b] == 'revolute':
                linear[:, b], angular[:, b] = np.cross(axis, centre - origin), axis
            else:
                linear[:, b] = axis
        body = turn @ self.inertias[link] @ turn.T
        return np.asarray(self.masses[link] * linear.T @ linear + angular.T @ body @ angular)

    def height(self, link: int, q: Array) -> float:
        return float(self.frames(q)[link][3][2])
