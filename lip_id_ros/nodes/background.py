"""Work beside the executor's thread, awaited by service callbacks."""

from __future__ import annotations

from concurrent.futures import Future as ThreadFuture
from typing import Any, TypeVar

from rclpy.node import Node
from rclpy.task import Future

Result = TypeVar('Result')


async def outcome(node: Node, work: ThreadFuture[Result]) -> Result:
    """
    Await work that another thread does, while the executor goes on with other callbacks.

    The awaiting callback must be in a callback group of its own, since a group waits for its
    callbacks.

    Parameters
    ----------
    node : Node
        Whose executor runs the awaiting callback.
    work : concurrent.futures.Future
        As a thread pool returns it.

    Returns
    -------
    Result
        What the work returned; what it raised is raised here.

    """
    done = Future(executor=node.executor)
    work.add_done_callback(lambda finished: _hand_over(finished, done))
    result: Result = await done
    return result


def _hand_over(finished: ThreadFuture[Any], done: Future) -> None:
    error = finished.exception()
    if error is None:
        done.set_result(finished.result())
    else:
        done.set_exception(error)
