"""Engines: run a function for each of many recordings, in one process, several, or on Ray."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
import os
import signal
from typing import Any, Protocol

from threadpoolctl import threadpool_limits

from lip_id_ros.errors import ConfigError, FitError, LipIdError, TransferError
from lip_id_ros.fleet.cache import code_version
from lip_id_ros.fleet.ray_pulse import INTERVAL_S, RayPulse
from lip_id_ros.progress import Progress

ATTEMPTS = 3
"""How often an item is tried whose process dies."""

TASK_BYTES = 512 * 2**20
"""Memory that Ray reserves for a task; one of a bag of 15 s needs 178 MB."""

TASKS_PER_CPU = 2
"""Most tasks in Ray's hands, so that neither it nor the driver holds a whole fleet."""

STORE_BYTES = 128 * 2**20
"""Shared memory of a local Ray cluster, which only holds results of a few tasks."""

SAFE_PATH = 'PYTHONSAFEPATH'

DIED = f'its process ended {ATTEMPTS} times before it was done, perhaps for want of memory'

Function = Callable[[Any], Any]
Keep = Callable[[int, Any], None]
Finish = Callable[[int, 'Outcome'], None]


@dataclass(frozen=True)
class Outcome:
    """Result of one item: a value, or None and a reason; final where it would fail again."""

    value: Any
    reason: str = ''
    is_final: bool = False


class Engine(AbstractContextManager['Engine'], Protocol):
    """
    Runs a function for each of many items; to be used in a `with` statement.

    A function that raises an error, or ends its process, fails for its item alone. Ctrl-C ends
    all processes; what `keep` was called with by then is kept.
    """

    def map(
        self, function: Function, items: Sequence[Any], progress: Progress, keep: Keep
    ) -> list[Outcome]:
        """
        Return the outcomes in the order of the items.

        The function is of a module, so that other processes can import it; `keep` gets number and
        value of an item as soon as it has one.
        """


class LocalEngine(Engine):
    """Runs in this process with `jobs` 1, or in several on this machine, each with one thread."""

    def __init__(self, jobs: int = 1) -> None:
        self._jobs = jobs
        self._idle: list[_Worker] = []
        self._running: dict[Connection, tuple[_Worker, int]] = {}

    def __exit__(self, *error: object) -> None:
        """End the processes."""
        for worker in self._idle:
            worker.end()
        self._idle.clear()

    def map(
        self, function: Function, items: Sequence[Any], progress: Progress, keep: Keep
    ) -> list[Outcome]:
        """Return the outcomes in the order of the items; see `Engine.map`."""
        results = _Results(len(items), progress, keep)
        if self._jobs == 1:
            for number, item in enumerate(items):
                results.finish(number, attempt(function, item))
        else:
            self._run(function, items, results.finish)
        return results.outcomes

    def _run(self, function: Function, items: Sequence[Any], finish: Finish) -> None:
        waiting = deque(range(len(items)))
        running = self._running
        deaths: Counter[int] = Counter()
        try:
            while waiting or running:
                while waiting and len(running) < self._jobs:
                    worker = self._idle.pop() if self._idle else _Worker()
                    number = waiting.popleft()
                    running[worker.connection] = worker, number
                    worker.start(function, items[number])
                ready = wait(list(running))
                for connection in [each for each in running if each in ready]:
                    worker, number = running.pop(connection)
                    outcome = worker.outcome()
                    if outcome is not None:
                        self._idle.append(worker)
                    else:
                        worker.end()
                        deaths[number] += 1
                        if deaths[number] < ATTEMPTS:
                            waiting.append(number)
                            continue
                        outcome = Outcome(None, DIED)
                    finish(number, outcome)
        finally:
            for worker, _ in running.values():  # after Ctrl-C
                worker.end()
            running.clear()


class _Worker:
    """A process that runs one item at a time: if it dies, it is known of which."""

    def __init__(self) -> None:
        context = get_context('spawn')  # a fork would share the locks of threads
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_work, args=(theirs,), daemon=True)
        with _safe_path():
            # inherited: Ctrl-C reaches the processes only through this one, while they start too
            resource_tracker.ensure_running()  # whose start unblocks the signal
            before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
            try:
                self._process.start()
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()

    def start(self, function: Function, item: Any) -> None:
        try:
            self.connection.send((function, item))
        except ConnectionError:  # it died while idle: `outcome` finds out
            return

    def outcome(self) -> Outcome | None:
        """Return the outcome that it sent; None where it died."""
        try:
            outcome: Outcome = self.connection.recv()
        except (EOFError, OSError):
            return None
        return outcome

    def end(self) -> None:
        self._process.kill()
        self._process.join()
        self.connection.close()


@contextmanager
def _safe_path() -> Iterator[None]:
    """Have processes that start meanwhile import no file of the working folder, as -P does."""
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = '1'
    try:
        yield
    finally:
        del os.environ[SAFE_PATH]
        if before is not None:
            os.environ[SAFE_PATH] = before


def _work(connection: Connection) -> None:
    with threadpool_limits(1):
        while True:
            try:
                function, item = connection.recv()
                connection.send(attempt(function, item))
            except (EOFError, ConnectionError):  # the parent is gone
                return


class RayEngine(Engine):
    """
    Runs as tasks of a Ray cluster.

    Ray repeats a task whose worker or machine dies. Without an address one is started here with
    `jobs` workers. ConfigError if Ray is not installed, no cluster answers, or a worker has
    another version of the code; FitError if the cluster does not answer any more.
    """

    def __init__(self, address: str | None = None, jobs: int | None = None) -> None:
        os.environ.setdefault('RAY_USAGE_STATS_ENABLED', '0')
        try:
            ray: Any = import_module('ray')
        except ImportError as error:
            raise ConfigError(
                "the engine ray needs Ray, which is not installed; pip install 'lip_id_ros[ray]', "
                'or choose the engine local.'
            ) from error
        self._ray = ray
        own = {'num_cpus': jobs, 'include_dashboard': False, 'object_store_memory': STORE_BYTES}
        quiet = {'logging_level': 'ERROR', 'log_to_driver': False}  # outcomes have the reasons
        try:
            ray.init(address=address or 'local', **quiet, **({} if address else own))
        except Exception as error:  # Ray has many kinds, some of the file system
            raise ConfigError(
                f'a Ray cluster was expected at {address or "this machine"}, but none can be '
                f'used ({error}); start one with `ray start`, name another address, or set '
                'RAY_AUTH_MODE=token where the cluster asks for its token.'
            ) from error
        self._pulse = RayPulse(ray, address)
        self._task = ray.remote(
            num_cpus=1,
            memory=TASK_BYTES,
            max_retries=ATTEMPTS - 1,
            runtime_env={'env_vars': dict.fromkeys(_THREADS, '1')},
        )(attempt_with_version)

    def __exit__(self, *error: object) -> None:
        """Leave the cluster, or end the one that was started."""
        self._ray.shutdown()

    def map(
        self, function: Function, items: Sequence[Any], progress: Progress, keep: Keep
    ) -> list[Outcome]:
        """Return the outcomes in the order of the items; see `Engine.map`."""
        results = _Results(len(items), progress, keep)
        running: dict[Any, int] = {}
        try:
            self._run(function, items, results.finish, running)
        except FitError:
            raise  # nobody is there to cancel tasks
        except BaseException:  # Ctrl-C, say
            for task in running:
                self._ray.cancel(task, force=True)
            raise
        return results.outcomes

    def _run(
        self, function: Function, items: Sequence[Any], finish: Finish, running: dict[Any, int]
    ) -> None:
        shared = self._ray.put(function)  # once, not with every task
        waiting = deque(range(len(items)))
        while waiting or running:
            cpus = self._ray.cluster_resources().get('CPU', 1)
            while waiting and len(running) < max(1, int(TASKS_PER_CPU * cpus)):
                number = waiting.popleft()
                running[self._task.remote(shared, items[number])] = number
            done, _ = self._ray.wait(list(running), num_returns=1, timeout=INTERVAL_S)
            for task in done:
                finish(running.pop(task), self._outcome(task))
            if not done:
                self._pulse.require()

    def _outcome(self, task: Any) -> Outcome:
        try:
            outcome: Outcome
            version, outcome = self._ray.get(task)
        except self._ray.exceptions.RayError as error:
            self._pulse.require()
            first = (str(error).strip() or type(error).__name__).splitlines()[0]
            return Outcome(None, f'{DIED} ({first})')
        if version != code_version():
            raise ConfigError(
                'all workers of the Ray cluster must have this lip_id_ros with its numpy, scipy '
                f'and numba (code {code_version()}), but one has another (code {version}); '
                'install the same there.'
            )
        return outcome


_THREADS = 'OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'NUMBA_NUM_THREADS'


def attempt(function: Function, item: Any) -> Outcome:
    """Call a function; an error becomes the reason of a failure."""
    try:
        return Outcome(function(item))
    except (LipIdError, OSError) as error:
        is_final = isinstance(error, LipIdError) and not isinstance(error, TransferError)
        return Outcome(None, ' '.join(str(error).split()) or type(error).__name__, is_final)
    except Exception as error:  # whatever a poisoned recording makes a library raise
        return Outcome(None, ' '.join(f'{type(error).__name__}: {error}'.split()))


def attempt_with_version(function: Function, item: Any) -> tuple[str, Outcome]:
    """Call a function as `attempt` does; say by which version of the code."""
    return code_version(), attempt(function, item)


class _Results:
    """Outcomes by number; reports each as it arrives."""

    def __init__(self, count: int, progress: Progress, keep: Keep) -> None:
        self.outcomes = [Outcome(None)] * count
        self._done = 0
        self._progress, self._keep = progress, keep
        progress('', 0, count)

    def finish(self, number: int, outcome: Outcome) -> None:
        self.outcomes[number] = outcome
        self._done += 1
        if not outcome.reason:
            self._keep(number, outcome.value)
        self._progress('', self._done, len(self.outcomes))
