"""What friction costs in a query, against the signs in it: ratios within one run."""

from __future__ import annotations

from collections.abc import Callable
import sys
import timeit

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.compiled import add_friction, CompiledFriction, friction_features
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionBasis, FrictionModel
from lip_id_ros.friction.terms import Coulomb, LoadCoulomb, Offset, Stribeck, Viscous
from lip_id_ros.numba_jit import jit

JOINTS, SIGNS, TIMES, REPEATS = 7, 4, 20_000, 20


def main(arguments: list[str]) -> int:
    """Time seven joints with four terms and an offset each, and as many tanh."""
    terms = (Viscous(), Coulomb(0.1), Offset(), Stribeck(0.1), LoadCoulomb(0.1))
    parts = tuple(DriveTerm(Drive.of_joint(j), term) for j in range(JOINTS) for term in terms)
    basis = FrictionBasis(JOINTS, parts)
    compiled = CompiledFriction.of(FrictionModel(basis, np.ones(basis.size)))
    state = np.random.default_rng(0).standard_normal((4, JOINTS))
    out = np.zeros(JOINTS)
    states = np.random.default_rng(0).standard_normal((4, TIMES, JOINTS))
    friction = _microseconds(lambda times: _friction(compiled, state, out, times))
    features = _microseconds(lambda times: friction_features(basis, *states[:, :times]))
    signs = _microseconds(lambda times: _signs(state[1], times))
    print(f'friction {friction:.3f} us a state, {SIGNS * JOINTS} signs {signs:.3f} us')
    print(f'{basis.size} features in a fit {features:.3f} us')
    print(f'ratios {friction / signs:.2f} and {features / signs:.2f}')
    return 0


def _microseconds(call: Callable[[int], object]) -> float:
    call(1)
    return 1e6 / TIMES * min(timeit.repeat(lambda: call(TIMES), number=1, repeat=REPEATS))


@jit
def _friction(friction: CompiledFriction, state: Array, out: Array, times: int) -> None:
    for _ in range(times):
        add_friction(friction, state[0], state[1], state[2], state[3], out)


@jit
def _signs(dq: Array, times: int) -> float:
    total = 0.0
    for k in range(times):
        for _ in range(SIGNS):
            for j in range(len(dq)):
                total += np.tanh(dq[j] + 1e-9 * k)
    return total


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
