"""The exported C header, a query from Python and pinocchio's C++ RNEA: a simulated Panda."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time

import numpy as np
import pinocchio

from benchmarks._cells import show
from lip_id_ros.arrays import Array
from lip_id_ros.description.urdf import load_description
from lip_id_ros.export.arm import ArmDescription, JointRanges
from lip_id_ros.export.c_header import to_c_header
from lip_id_ros.export.urdf import to_urdf
from lip_id_ros.friction.compiled import CompiledFriction
from lip_id_ros.friction.model import FrictionModel, plain_friction
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.model.arm_mean import ArmMean
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.simulation.arm import panda_urdf

PROGRAM = Path(__file__).with_suffix('.cpp')
PREFIX = Path(sysconfig.get_path('purelib')) / 'cmeel.prefix'
EIGEN = (PREFIX / 'include' / 'eigen3', Path('/usr/include/eigen3'))
FLAGS = ('-O2', '-O3 -march=native')
LIMITS = (
    '-DBOOST_MPL_LIMIT_LIST_SIZE=30',
    '-DBOOST_MPL_LIMIT_VECTOR_SIZE=30',
    '-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS',
    '-DBOOST_FUSION_INVOKE_MAX_ARITY=12',
)
"""Pinocchio's variant of joints has more types than Boost allows without these."""
FROM_LIBRARY = (
    '-DPINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION -lpinocchio_default '
    f'{shlex.quote(f"-L{PREFIX}/lib")} {shlex.quote(f"-Wl,-rpath,{PREFIX}/lib")}'
)
"""Flags that take RNEA from pinocchio's library: compiled in a sixth of the time, not inlined."""
SAME, STATES = 1e-9, 10_000
COLUMNS = {
    'flags': 'compiled with',
    'header_ns': 'torques and energies, header [ns]',
    'query_ns': 'the same, query from Python [ns]',
    'rnea_ns': 'torques, pinocchio [ns]',
    'ratio': 'ratio',
    'difference': 'difference of links',
}


def main(arguments: list[str]) -> int:
    """Measure, print a table; exit status 1 where the torques of the links differ."""
    parser = argparse.ArgumentParser(prog='benchmarks c_against_pinocchio', description=__doc__)
    parser.add_argument('--blocks', type=int, default=20, help='medians are over so many blocks')
    parser.add_argument('--flags', nargs='+', default=FLAGS, help='of the compiler')
    parser.add_argument('--eigen', type=Path, help='folder of the headers of Eigen')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    options = parser.parse_args(arguments)
    eigen = options.eigen or next((x for x in EIGEN if x.is_dir()), None)
    if eigen is None or shutil.which('g++') is None:
        print(
            'g++ and the headers of Eigen were expected, which those of pinocchio include, but '
            'one is missing; install g++ and `pip install cmeel-eigen`, or give --eigen.',
            file=sys.stderr,
        )
        return 2
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        arm = _export(folder)
        rows = [
            {**measured(folder, eigen, flags, options.blocks), 'query_ns': f'{query_ns(arm):.0f}'}
            for flags in options.flags
        ]
    show('A Panda of 7 joints with friction, medians of single calls', COLUMNS, rows, 130)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return int(any(float(row['difference']) > SAME for row in rows))


def measured(folder: Path, eigen: Path, flags: str, blocks: int) -> dict[str, str]:
    """Compile the program, run it, and return its medians."""
    includes = [f'-I{x}' for x in (folder, eigen, PREFIX / 'include')]
    compiler = ['g++', '-std=c++17', '-w', '-DNDEBUG']
    command: list[str | Path] = [*compiler, *LIMITS, *includes, PROGRAM]
    program = folder / 'program'
    subprocess.run([*command, *shlex.split(flags), '-o', program], check=True)
    with open(folder / 'joints', encoding='utf-8') as joints:
        ran = subprocess.run(
            [program, str(blocks)], stdin=joints, stdout=subprocess.PIPE, check=True, text=True
        )
    *lines, difference = ran.stdout.split('\n')[:-1]
    header, rnea = np.median(np.array([line.split() for line in lines], dtype=float), axis=0)
    return {
        'flags': flags,
        'header_ns': f'{header:.0f}',
        'rnea_ns': f'{rnea:.0f}',
        'ratio': f'{header / rnea:.2f}',
        'difference': difference,
    }


def query_ns(arm: ArmDescription) -> float:
    """Return the median of single queries of an arm, compiled, from Python."""
    size = len(arm.joint_names)
    noise = TorqueNoise.constant(np.ones(size))
    posterior = ArmPosterior(arm.chain, arm.links, arm.friction, noise, np.zeros((0, 0)))
    query = ArmMean(posterior, CompiledFriction.of(arm.friction), None).one
    states = np.random.default_rng(0).uniform(-1.0, 1.0, (STATES, 3, size))
    query(*states[0])  # compiles
    times = []
    for state in states:
        begun = time.perf_counter_ns()
        query(*state)
        times.append(time.perf_counter_ns() - begun)
    return float(np.median(times))


def _export(folder: Path) -> ArmDescription:
    """Write the simulated Panda with viscous and Coulomb friction as `arm.h` and `joints`."""
    names = tuple(f'panda_joint{i + 1}' for i in range(7))
    description = load_description(panda_urdf(), names, ('revolute',) * len(names))
    ones: Array = np.ones(len(names))
    basis = plain_friction(len(names), (0.05 * ones).tolist())
    arm = ArmDescription(
        name='arm',
        joint_names=names,
        chain=description.chain,
        links=description.links,
        friction=FrictionModel(basis, np.full(basis.size, 0.5)),
        ranges=JointRanges(-ones, ones, ones, ones, ones),
        potential_reference=0.0 * ones,
    ).in_standard_frames()
    (folder / 'arm.h').write_text(to_c_header(arm), encoding='utf-8')
    model = pinocchio.buildModelFromXML(to_urdf(arm))
    numbers = [arm.chain.gravity]
    for place, body in list(zip(model.jointPlacements, model.inertias, strict=True))[1:]:
        numbers += [place.rotation.ravel('F'), place.translation, body.toDynamicParameters()]
    np.savetxt(folder / 'joints', np.concatenate(numbers), fmt='%.17g')
    return arm
