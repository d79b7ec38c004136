"""
A fleet of 200 bags: 20 simulated robots of one type, 3 damaged bags, 2 bags of another arm.

``python -m benchmarks fleet --joints 4`` writes the bags, and fits them in one process, again with
one more bag, and on a local Ray cluster of two workers, one of which is killed.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
import pickle
import re
import tempfile
import time
from typing import Any

import numpy as np
import psutil

from benchmarks._arms import FrictionalArm, JointFriction, with_wrong_masses
from benchmarks._panda import half_ranges
from lip_id_ros.arrays import Array
from lip_id_ros.fleet.cache import FolderCache
from lip_id_ros.fleet.engines import Engine, Keep, LocalEngine, Outcome, RayEngine
from lip_id_ros.fleet.fit import fit_fleet
from lip_id_ros.fleet.passes import Cache
from lip_id_ros.fleet.report import write_fleet_report
from lip_id_ros.fleet.results import FITTED, FleetResult
from lip_id_ros.fleet.sources import find, StoredRecording
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import Config
from lip_id_ros.simulation import make_dataset, panda, SinusoidTrajectory, write_bag

ROBOTS = 20
RATE_HZ, SECONDS = 100.0, 15.0
NOISE_STD = 0.05  # [N m]
FUNDAMENTAL_HZ, SINUSOIDS = 0.1, 8
SPREAD = 0.2  # of friction between robots, as a share
DAY_S = 86400.0
START_S = 1.7e9
DAMAGED, FOREIGN = range(50, 53), range(7, 9)
GROUP = r'(robot\d+)'


class Fleet:
    """Robots of one type, an arm of another, and the bags of both in a folder."""

    def __init__(self, folder: Path, n_joints: int) -> None:
        rng = np.random.default_rng(0)
        self.folder, self._n, self._arm = folder, n_joints, panda(n_joints)
        self._other = with_wrong_masses(self._arm, 0.5, 0.05, rng)
        self._friction = [self._drawn(rng) for _ in range(ROBOTS)]

    def _drawn(self, rng: np.random.Generator) -> JointFriction:
        usual = np.full((2, self._n), [[0.8], [1.2]])
        viscous, coulomb = usual * (1.0 + SPREAD * rng.standard_normal((2, self._n)))
        return JointFriction(viscous, coulomb, 0.05)

    def write(self, count: int) -> list[str]:
        """Write the bags that do not exist yet; return the names of those to be left out."""
        bags = [self._bag(number) for number in range(count)]
        for number, bag in enumerate(bags):
            if not bag.exists():
                self.write_run(bag, number)
                if number in DAMAGED:
                    _damage(next(bag.glob('*.mcap')), number - DAMAGED.start)
        return [str(bags[number]) for number in (*FOREIGN, *DAMAGED) if number < count]

    def _bag(self, number: int) -> Path:
        run, robot = divmod(number, ROBOTS)
        return self.folder / f'robot{robot:02d}' / f'run{run:02d}'

    def write_run(self, bag: Path, number: int) -> None:
        """Write one bag."""
        rng = np.random.default_rng(1000 + number)
        motion = SinusoidTrajectory.random(half_ranges(self._n), rng, SINUSOIDS, FUNDAMENTAL_HZ)
        t = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
        arm = self._other if number in FOREIGN else self._arm
        frictional = FrictionalArm(arm, self._friction[number % ROBOTS])
        bag.parent.mkdir(parents=True, exist_ok=True)
        data = make_dataset(frictional, motion, t, NOISE_STD, rng)
        write_bag(bag, data, START_S + number * DAY_S)


def _damage(storage: Path, kind: int) -> None:
    """Empty a file, keep a few bytes of it, or overwrite it with noise."""
    content = storage.read_bytes()
    noise = np.random.default_rng(kind).bytes(len(content))
    storage.write_bytes((b'', content[:100], noise)[kind])


class Measured(Engine):
    """An engine that measures the size of its results and tells how many items are done."""

    def __init__(self, engine: Engine, during: Callable[[int], None] = lambda done: None) -> None:
        self._engine, self._during = engine, during
        self.largest, self.total = 0, 0

    def __exit__(self, *error: object) -> None:
        """End the engine."""
        self._engine.__exit__(None, None, None)

    def map(
        self, function: Callable[[Any], Any], items: Sequence[Any], progress: Progress, keep: Keep
    ) -> list[Outcome]:
        """Return the outcomes of the engine."""

        def weigh(number: int, value: Any) -> None:
            size = len(pickle.dumps(value, protocol=5))
            self.largest, self.total = max(self.largest, size), self.total + size
            keep(number, value)

        def report(stage: str, done: int, total: int) -> None:
            self._during(done)
            progress(stage, done, total)

        return list(self._engine.map(function, items, report, weigh))


@dataclass
class Run:
    """A fit, and its seconds: of CPU time of this process, and elapsed ones."""

    result: FleetResult
    cpu_s: float
    elapsed_s: float


def timed(
    name: str, engine: Measured, sources: Sequence[StoredRecording], cache: Cache | None = None
) -> Run:
    """Fit, and print what it took."""
    with engine:
        cpu, begun = time.process_time(), time.perf_counter()
        result = fit_fleet(sources, Config(), engine, cache, silent)
        run = Run(result, time.process_time() - cpu, time.perf_counter() - begun)
    count = len(result.recordings)
    fitted = sum(each.status == FITTED for each in result.recordings)
    print(
        f'{name}: {run.cpu_s:.1f} s of CPU time of the driver, {run.elapsed_s:.1f} s elapsed; '
        f'{fitted} of {count} fitted; results {engine.largest} bytes at most, '
        f'{engine.total / count:.0f} per recording',
        flush=True,
    )
    return run


def difference(a: FleetResult, b: FleetResult) -> float:
    """Return the largest difference of parameters, over the largest of its kind or 1."""
    return max(
        float(np.max(np.abs(x - y)) / max(np.max(np.abs(x)), 1.0))
        for x, y in zip(_parameters(a), _parameters(b), strict=True)
        if x.size or y.size
    )


def _parameters(result: FleetResult) -> list[Array]:
    arm = result.model.arm
    assert arm is not None
    fitted = [each for each in result.recordings if each.status == FITTED]
    own = np.array([each.friction for each in sorted(fitted, key=lambda each: each.name)])
    chain = (np.asarray(each, dtype=float) for each in arm.chain)
    return [*chain, arm.links, arm.friction.coefficients, own]


def worker_killer() -> Callable[[int], None]:
    """Return a function that kills one worker of Ray, when ten items of a pass are done."""
    killed: list[int] = []

    def kill(done: int) -> None:
        if done < 10 or killed:
            return
        for process in psutil.Process().children(recursive=True):
            if re.match('ray::attempt', ' '.join(process.cmdline())):
                process.kill()
                killed.append(process.pid)
                print(f'killed worker {process.pid} after {done} recordings')
                return

    return kill


def main(arguments: list[str]) -> int:
    """Run the benchmark; return 1 where a promise is not kept."""
    parser = argparse.ArgumentParser(prog='benchmarks fleet', description=__doc__)
    parser.add_argument('--folder', type=Path, help='where bags are, or are written')
    parser.add_argument('--joints', type=int, default=7)
    parser.add_argument('--bags', type=int, default=200)
    parser.add_argument('--report', type=Path, help='write the page of the fleet')
    args = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as scratch:
        return _compare(args, args.folder or Path(scratch) / 'bags', Path(scratch))


def _compare(args: argparse.Namespace, folder: Path, scratch: Path) -> int:
    fleet, cache = Fleet(folder, args.joints), FolderCache(scratch / 'cache')
    odd = fleet.write(args.bags)
    sources = find([str(folder)], GROUP)
    one = timed('one process', Measured(LocalEngine(1)), sources, cache)
    left_out = [each for each in one.result.recordings if each.status != FITTED]
    for each in left_out:
        print(f'{Path(each.name).relative_to(folder)} {each.status}: {each.reason[:120]}')
    named = {each.name for each in left_out} == set(odd)
    print(f'left out {len(left_out)}, those of the fleet that do not belong to it: {named}')
    if args.report:
        write_fleet_report(args.report, one.result)
    more = folder.parent / 'more' / 'robot00' / 'run99'
    if not more.exists():
        fleet.write_run(more, ROBOTS * 99)
    both = find([str(folder), str(more)], GROUP)
    again = timed('one more bag', Measured(LocalEngine(1)), both, cache)
    share = again.cpu_s / one.cpu_s
    print(f'one more bag takes {share:.3f} of the CPU time', flush=True)
    killed = timed(
        'Ray, two workers, one killed', Measured(RayEngine(jobs=2), worker_killer()), sources
    )
    found = difference(one.result, killed.result)
    print(f'largest relative difference of parameters to one process {found:.1e}', flush=True)
    return int(not named or found > 1e-9 or share >= 0.1)
