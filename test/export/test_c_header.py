"""The C header in particular."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from pathlib import Path
import re
import shutil
import subprocess

from export.arms import arm_of, COUPLED, random_arm
from export.readers import compile_c, states_of
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.c_header import identifier, to_c_header
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)

pytestmark = pytest.mark.skipif(shutil.which('gcc') is None, reason='needs gcc')
STRICT = ('-Wall', '-Wextra', '-pedantic', '-Werror', '-Wconversion', '-Wshadow')
EXPORTED = """
#include "arm.h"
void dynamics(const double *q, const double *dq, const double *ddq, double *tau, double *t,
              double *v) {{ {name}_dynamics(q, dq, ddq, tau, t, v); }}
void torque(const double *q, const double *dq, const double *ddq, double *tau)
{{ {name}_torque(q, dq, ddq, tau); }}
void parts(const double *q, const double *dq, const double *ddq, double *all)
{{
  {name}_parts p;
  {name}_torque_parts(q, dq, ddq, &p);
  for (int i = 0; i < {n}; i++) {{
    all[i] = p.tau[i];
    all[{n} + i] = p.inertial[i];
    all[2 * {n} + i] = p.coriolis[i];
    all[3 * {n} + i] = p.gravity[i];
    all[4 * {n} + i] = p.friction[i];
  }}
}}
void gravity(const double *q, double *out) {{ {name}_gravity(q, out); }}
void inertia(const double *q, double *out) {{ {name}_inertia_matrix(q, out); }}
double kinetic(const double *q, const double *dq) {{ return {name}_kinetic_energy(q, dq); }}
double potential(const double *q) {{ return {name}_potential_energy(q); }}
"""


class Compiled:
    def __init__(self, arm: ArmDescription, folder: Path) -> None:
        (folder / 'arm.h').write_text(to_c_header(arm))
        (folder / 'arm.c').write_text(EXPORTED.format(name=arm.name, n=arm.n_joints))
        build(folder, 'gcc', '-std=c11', '-shared', '-fPIC', '-o', 'arm.so', 'arm.c', '-lm')
        self._library = ctypes.CDLL(str(folder / 'arm.so'))
        for name in ('kinetic', 'potential'):
            getattr(self._library, name).restype = ctypes.c_double

    def call(self, name: str, *arrays: Array) -> float:
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in arrays]
        return float(getattr(self._library, name)(*pointers))


def build(folder: Path, compiler: str, *arguments: str) -> None:
    ran = subprocess.run(
        [compiler, '-O1', *STRICT, *arguments],
        capture_output=True,
        text=True,
        check=False,
        cwd=folder,
    )
    assert ran.returncode == 0, ran.stderr


@pytest.mark.parametrize('name', ['panda', 'RPRPRR', 'P', COUPLED])
def test_every_function(name: str, tmp_path: Path) -> None:
    if name == 'panda':
        pytest.importorskip('pinocchio')
    arm = arm_of(name)
    compiled, n = Compiled(arm, tmp_path), arm.n_joints
    p = arm.links.ravel()
    states = states_of(arm, 20)
    zero = np.zeros((1, n))
    for q, dq, ddq in states.transpose(1, 0, 2):
        one = q[None], dq[None], ddq[None]
        tau, energies, parts = np.empty(n), np.empty(2), np.empty((5, n))
        compiled.call('dynamics', q, dq, ddq, tau, energies[:1], energies[1:])
        np.testing.assert_allclose(tau, arm.torque(*one)[0], rtol=1e-12, atol=1e-11)
        kinetic = (kinetic_regressor(arm.chain, *one[:2]) @ p)[0]
        potential = (potential_regressor(arm.chain, one[0]) @ p)[0] - arm.reference_potential()
        np.testing.assert_allclose(energies, [kinetic, potential], rtol=1e-12, atol=1e-11)
        assert compiled_energy(compiled, 'kinetic', q, dq) == pytest.approx(kinetic, abs=1e-11)
        assert compiled_energy(compiled, 'potential', q) == pytest.approx(potential, abs=1e-11)
        again = np.empty(n)
        compiled.call('torque', q, dq, ddq, again)
        np.testing.assert_array_equal(again, tau)

        gravity = (torque_regressor(arm.chain, one[0], zero, zero) @ p)[0]
        inertial = (torque_regressor(arm.chain, one[0], zero, one[2]) @ p)[0] - gravity
        coriolis = (torque_regressor(arm.chain, one[0], one[1], zero) @ p)[0] - gravity
        compiled.call('parts', q, dq, ddq, parts)
        np.testing.assert_allclose(parts[0], tau, rtol=1e-12, atol=1e-11)
        np.testing.assert_allclose(parts[1:4], [inertial, coriolis, gravity], atol=1e-10)
        np.testing.assert_allclose(parts[1:].sum(axis=0), parts[0], atol=1e-10)
        compiled.call('gravity', q, again)
        np.testing.assert_allclose(again, gravity, atol=1e-11)

        matrix = np.empty((n, n))
        compiled.call('inertia', q, matrix)
        np.testing.assert_allclose(matrix @ ddq, inertial, atol=1e-10)
        np.testing.assert_array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix)[0] > 0.0


def compiled_energy(compiled: Compiled, name: str, *arrays: Array) -> float:
    return compiled.call(name, *arrays)


def test_the_potential_is_zero_at_its_reference(tmp_path: Path) -> None:
    arm = random_arm('RPR')
    assert Compiled(arm, tmp_path).call('potential', arm.potential_reference) == pytest.approx(
        0.0, abs=1e-12
    )


@pytest.mark.skipif(shutil.which('g++') is None, reason='needs g++')
def test_two_arms_in_one_program_of_cpp(tmp_path: Path) -> None:
    for kinds in ('RPR', 'RR'):
        (tmp_path / f'{kinds}.h').write_text(to_c_header(random_arm(kinds)))
    program = """
#include "RPR.h"
#include "RR.h"
#include <array>
int main() {
  std::array<double, arm_RPR_n> q{}, tau{};
  arm_RPR_torque(q.data(), q.data(), q.data(), tau.data());
  return tau[0] == 1.0;
}
""".replace('arm_RPR_n', 'ARM_RPR_JOINTS')
    (tmp_path / 'two.cpp').write_text(program)
    build(tmp_path, 'g++', '-std=c++17', '-o', 'two', 'two.cpp')
    assert subprocess.run([tmp_path / 'two'], check=False).returncode == 0


@pytest.mark.parametrize(
    ('name', 'expected'),
    [('arm', 'arm'), ('7 dof', 'arm_7_dof'), ('ur-10e', 'ur_10e'), ('...', 'arm'), ('é', 'arm')],
)
def test_names_for_c(name: str, expected: str) -> None:
    assert identifier(name) == expected


def test_names_of_joints_stay_in_their_comment(tmp_path: Path) -> None:
    arm = replace(random_arm('RRR'), joint_names=('x*/int evil;/*', 'end??/', 'a/*/b\nint c;'))
    text = to_c_header(arm)
    plain = to_c_header(random_arm('RRR'))
    code = [re.sub(r'/\*.*?\*/', '', each, flags=re.DOTALL) for each in (text, plain)]
    assert code[0] == code[1]
    assert '??' not in text
    assert compile_c(text, arm, tmp_path).exists()
