from __future__ import annotations

from collections.abc import Iterator
from functools import partial
import os
from pathlib import Path
import signal
import subprocess
import sys
from typing import Any

from fleet.tasks import square, troubled
import psutil
import pytest
from waiting import wait_until

from lip_id_ros.errors import ConfigError
from lip_id_ros.fleet.cache import FolderCache
from lip_id_ros.fleet.engines import (
    ATTEMPTS,
    DIED,
    Engine,
    LocalEngine,
    Outcome,
    RayEngine,
)
from lip_id_ros.progress import silent

HERE = Path(__file__).resolve().parent


def ignore(number: int, value: Any) -> None:
    """Keep nothing."""


def has_ended(process: psutil.Process) -> bool:
    return bool(process.status() == psutil.STATUS_ZOMBIE)


def import_paths() -> str:
    return os.pathsep.join([str(HERE.parent), str(HERE.parents[1]), *filter(None, sys.path)])


@pytest.fixture(scope='module', params=['one process', 'two processes', 'ray'])
def engine(request: pytest.FixtureRequest) -> Iterator[Engine]:
    if request.param != 'ray':
        with LocalEngine(1 if request.param == 'one process' else 2) as local:
            yield local
        return
    pytest.importorskip('ray', reason='Ray is not installed')
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('PYTHONPATH', import_paths())  # so that workers find the tasks
        with RayEngine(jobs=2) as ray:
            yield ray


@pytest.fixture
def processes(engine: Engine) -> Engine:
    if getattr(engine, '_jobs', 0) == 1:
        pytest.skip('one process cannot outlive itself')
    return engine


@pytest.mark.slow
def test_outcomes_have_the_order_of_the_items(engine: Engine) -> None:
    kept: dict[int, int] = {}
    seen: list[tuple[int, int]] = []
    outcomes = engine.map(
        square,
        range(20),
        lambda stage, done, total: seen.append((done, total)),
        lambda number, value: kept.update({number: value[0]}),
    )
    assert [each.value[0] for each in outcomes] == [k**2 for k in range(20)]
    assert kept == {k: k**2 for k in range(20)}
    assert seen == [(k, 20) for k in range(21)]


@pytest.mark.slow
def test_work_is_shared_by_processes(processes: Engine) -> None:
    pids = {each.value[1] for each in processes.map(square, range(50), silent, ignore)}
    assert pids
    assert os.getpid() not in pids


@pytest.mark.slow
def test_an_error_fails_for_its_item_alone(engine: Engine) -> None:
    outcomes = engine.map(troubled, ['fine', 'error', 'defect', 'fine'], silent, ignore)
    assert outcomes == [
        Outcome('fine'),
        Outcome(None, 'the bag is empty.', is_final=True),
        Outcome(None, 'ZeroDivisionError: of a library'),
        Outcome('fine'),
    ]


@pytest.mark.slow
def test_an_item_whose_process_dies_is_repeated(processes: Engine, tmp_path: Path) -> None:
    items = ['fine', f'once {tmp_path / "died"}', *['fine'] * 6]
    outcomes = processes.map(troubled, items, silent, ignore)
    assert (tmp_path / 'died').exists()
    assert [each.value for each in outcomes] == ['fine', 'once', *['fine'] * 6]


@pytest.mark.slow
def test_an_item_that_always_ends_its_process_fails_alone(processes: Engine) -> None:
    kept: list[int] = []
    items = ['fine', 'dies', *['fine'] * 6]
    outcomes = processes.map(troubled, items, silent, lambda k, _: kept.append(k))
    assert outcomes[1].value is None
    assert outcomes[1].reason.startswith(DIED)
    assert str(ATTEMPTS) in DIED
    assert [each.value for each in outcomes if not each.reason] == ['fine'] * 7
    assert sorted(kept) == [0, 2, 3, 4, 5, 6, 7]


@pytest.mark.slow
def test_a_process_that_dies_between_maps_is_replaced() -> None:
    with LocalEngine(2) as engine:
        pids = {each.value[1] for each in engine.map(square, range(4), silent, ignore)}
        for pid in pids:
            process = psutil.Process(pid)
            process.kill()
            wait_until(partial(has_ended, process), 'the end of a worker')
        outcomes = engine.map(square, range(4), silent, ignore)
    assert [each.value[0] for each in outcomes] == [0, 1, 4, 9]


@pytest.mark.slow
@pytest.mark.usefixtures('strange_modules')
def test_processes_run_no_file_of_the_working_folder() -> None:
    with LocalEngine(2) as engine:
        outcomes = engine.map(square, range(4), silent, ignore)
    assert [each.value[0] for each in outcomes] == [0, 1, 4, 9]
    assert 'PYTHONSAFEPATH' not in os.environ


INTERRUPTED = """
import sys
from fleet.tasks import waits
from lip_id_ros.fleet.cache import FolderCache
from lip_id_ros.fleet.engines import LocalEngine
from lip_id_ros.progress import silent

def main():
    folder, started = sys.argv[1:]
    cache = FolderCache(folder)
    items = [('done', ''), ('done', ''), ('wait', started), ('wait', started)]
    keep = lambda number, value: cache.__setitem__(f'{number:064x}.survey', b'')
    with LocalEngine(2) as engine:
        try:
            engine.map(waits, items, silent, keep)
        except KeyboardInterrupt:
            print('interrupted')

if __name__ == '__main__':
    main()
"""


@pytest.mark.slow
def test_ctrl_c_ends_all_processes_and_leaves_what_was_kept(tmp_path: Path) -> None:
    script, started = tmp_path / 'fit.py', tmp_path / 'started'
    script.write_text(INTERRUPTED)
    running = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path / 'cache'), str(started)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {'PYTHONPATH': import_paths()},
        start_new_session=True,
        # what a shell without job control starts in the background ignores it, and so would this
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    kept = FolderCache(tmp_path / 'cache')
    first = [f'{k:064x}.survey' for k in (0, 1)]
    wait_until(
        lambda: started.exists() and all(kept.get(key) is not None for key in first),
        'the work before Ctrl-C',
    )
    children = psutil.Process(running.pid).children(recursive=True)
    os.killpg(running.pid, signal.SIGINT)
    output, errors = running.communicate()
    assert running.returncode == 0, errors
    assert output == 'interrupted\n'
    assert 'Traceback' not in errors
    psutil.wait_procs(children, timeout=60)
    assert not [each for each in children if each.is_running()]
    assert all(kept.get(key) is not None for key in first)


LOSES_ITS_CLUSTER = """
from pathlib import Path
from threading import Thread
from fleet.tasks import waits
import psutil
from lip_id_ros.errors import LipIdError
from lip_id_ros.fleet.engines import RayEngine
from lip_id_ros.progress import silent
from waiting import wait_until

def lose(place):
    wait_until(place.exists, 'a task')
    for process in psutil.Process().children(recursive=True):
        if process.name() == 'raylet':
            process.kill()

place = Path({place!r})
with RayEngine(jobs=2) as engine:
    Thread(target=lose, args=(place,), daemon=True).start()
    try:
        engine.map(waits, [('wait', place)] * 3, silent, lambda number, value: None)
    except LipIdError as error:
        print(error)
"""


@pytest.mark.slow
def test_a_cluster_that_dies_in_mid_fit_is_one_sentence(tmp_path: Path) -> None:
    pytest.importorskip('ray', reason='Ray is not installed')
    script = tmp_path / 'driver.py'
    script.write_text(LOSES_ITS_CLUSTER.format(place=str(tmp_path / 'waits')))
    done = subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        env=os.environ | {'PYTHONPATH': import_paths()},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    said = 'the Ray cluster was expected to answer until the fit is done, but nobody listens at'
    (line,) = (each for each in done.stdout.splitlines() if each.startswith(said))
    assert line.endswith('the engine local, from what the cache has.')
    assert 'Traceback' not in done.stderr


def test_ray_that_cannot_start_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('ray', reason='Ray is not installed')
    monkeypatch.setenv('RAY_TMPDIR', '/proc/nowhere')
    with pytest.raises(ConfigError, match=r'expected at this machine, but none can be used \('):
        RayEngine(jobs=1)


def test_an_engine_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'ray', None)
    with pytest.raises(ConfigError, match=r'needs Ray, which is not installed; .*engine local\.'):
        RayEngine()
