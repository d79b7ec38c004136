"""Run one node in this process, until a signal asks it to stop in good order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future as ThreadFuture
from contextlib import contextmanager
import gc
import signal
import threading
import time
from types import FrameType
from typing import Any, TypeVar

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from lip_id_ros.errors import LipIdError, one_line
from lip_id_ros.nodes.node import NodeBase

Result = TypeVar('Result')

BROKEN_SECONDS = 5.0
"""The executor itself is broken when it raises for so long without running a callback."""

HEED_SECONDS = 0.5
"""Signals are heeded at least so often."""

START_ERRORS = (
    *(LipIdError, OSError, ParameterException),
    *(rclpy_implementation.RCLError, rclpy_implementation.UnknownROSArgsError),
)
"""Errors of wrong arguments, such as a parameter file that is not YAML, or of their values."""


def run(make_node: Callable[[], NodeBase], arguments: Sequence[str] | None = None) -> int:
    """
    Spin a node until SIGINT, SIGTERM or SIGHUP, then stop it in order; return the exit status.

    The signals are taken by the main thread, and the node spins in another: so the context is
    still alive when the node stops, and its last messages go out. The status is 1, with one line
    in the log, if the node could not be made or stopped in good order.
    """
    stopped = _stop_event()
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
    except START_ERRORS as error:
        get_logger('lip_id_ros').fatal(in_words(error))
        rclpy.try_shutdown()
        return 1
    _spare_collections()
    try:
        _spin(node, stopped)
    finally:  # after an error of the executor too: the robot is released, the data is kept
        ended = _stop(node)
    return ended


def in_words(error: Exception) -> str:
    """Return the sentence of a `START_ERRORS`."""
    if isinstance(error, rclpy_implementation.UnknownROSArgsError):
        return f'there are no such ROS arguments: {error}; correct them.'
    return one_line(error)


def _spare_collections() -> None:
    """Leave what was loaded out of later garbage collections, which took 60 ms and more."""
    gc.collect()
    gc.freeze()


def _stop(node: NodeBase) -> int:
    try:
        node.stop()
    except LipIdError as error:
        get_logger('lip_id_ros').fatal(str(error))
        return 1
    finally:
        node.destroy_node()
        rclpy.shutdown()
    return 0


def _stop_event() -> threading.Event:
    stopped = threading.Event()

    def stop(number: int, frame: FrameType | None) -> None:
        stopped.set()

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as nohup has it
        signal.signal(signal.SIGHUP, stop)  # the terminal was closed
    return stopped


def _spin(node: NodeBase, stopped: threading.Event) -> None:
    executor = make_executor(node.get_parameter('executor').value)
    executor.add_node(node)
    failures: list[BaseException] = []

    def spin(end: Future) -> None:
        try:
            _spin_on(executor, node, end)
        except BaseException as error:
            failures.append(error)
        finally:
            stopped.set()

    with _in_thread(executor, spin):
        # a signal to a paused process may be taken by another thread, which does not wake this one
        while not stopped.wait(HEED_SECONDS):
            pass
    if failures:
        raise failures[0]


@contextmanager
def spinning(*nodes: Node, executor: Executor) -> Iterator[None]:
    """Spin nodes in another thread while the block runs."""
    for node in nodes:
        executor.add_node(node)
    with _in_thread(executor, executor.spin_until_future_complete):
        yield


@contextmanager
def _in_thread(executor: Executor, spin: Callable[[Future], None]) -> Iterator[None]:
    """
    Call `spin` in another thread while the block runs; its argument is done with the block.

    The executor is shut down once it spins no more: rclpy takes its guard conditions away from
    under an executor that spins, which may end it with an AttributeError.
    """
    end = Future()
    thread = threading.Thread(target=spin, args=[end], name='executor')
    thread.start()
    try:
        yield
    finally:
        end.set_result(None)
        thread.join()
        executor.shutdown()


def _spin_on(executor: Executor, node: NodeBase, end: Future) -> None:
    """Spin again after an error past the guards, such as of a message of random bytes."""
    n_run, since = -1, 0.0  # at the first error since a callback ran
    while not end.done():
        try:
            executor.spin_until_future_complete(end)
            return
        except ExternalShutdownException:
            return
        except Exception as error:
            if node.n_callbacks > n_run:
                n_run, since = node.n_callbacks, time.monotonic()
            if time.monotonic() - since > BROKEN_SECONDS:
                raise
            node.caught(error)


def make_executor(name: str) -> Executor:
    """
    Make the executor 'events' or 'single_threaded'.

    The first takes less CPU at high rates; where this ROS has none, it is the default executor.
    """
    if name == 'events':
        try:
            from rclpy.experimental import EventsExecutor
        except ImportError:
            return SingleThreadedExecutor()
        return EventsExecutor()
    return SingleThreadedExecutor()


async def outcome(node: Node, work: ThreadFuture[Result]) -> Result:
    """
    Await work that another thread does, while the executor goes on with other callbacks.

    The awaiting callback must be in a callback group of its own, since a group waits for its
    callbacks.

    `node`: whose executor runs the awaiting callback. `work`: as a thread pool returns it. Returns
    what the work returned; what it raised is raised here.

    """
    done = Future(executor=node.executor)
    work.add_done_callback(lambda finished: _settle(finished, done))
    result: Result = await done
    return result


def _settle(finished: ThreadFuture[Any], done: Future) -> None:
    error = finished.exception()
    if error is None:
        done.set_result(finished.result())
    else:
        done.set_exception(error)
