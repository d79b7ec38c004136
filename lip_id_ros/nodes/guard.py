"""The last resort around the callbacks of a node: whatever comes over the graph, it lives on."""

from __future__ import annotations

from collections.abc import Callable
import functools
import inspect
import traceback
from typing import Any

from rclpy.node import Node


class GuardedNode(Node):
    """
    A node that no message and no request can end.

    An exception that a subscription, a service or a timer lets through is logged and counted, the
    robot gets the safe torque, and a service answers without success. Refusals are not such
    exceptions: they are handled where they arise.

    """

    faults = 0
    """How many exceptions were caught."""
    last_fault = ''
    """The last one, in words."""

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Any, *args: Any, **options: Any
    ) -> Any:
        """Create a guarded subscription."""
        guarded = self._guarded(callback)
        return super().create_subscription(msg_type, topic, guarded, *args, **options)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **options: Any) -> Any:
        """Create a guarded service."""
        return super().create_service(srv_type, srv_name, self._guarded(callback), **options)

    def create_timer(
        self, timer_period_sec: float, callback: Any, *args: Any, **options: Any
    ) -> Any:
        """Create a guarded timer."""
        return super().create_timer(timer_period_sec, self._guarded(callback), *args, **options)

    def guard_services(self) -> None:
        """Guard services that were created without `create_service`, as those of a lifecycle."""
        for service in self.services:
            if not hasattr(service.callback, '__wrapped__'):
                service.callback = self._guarded(service.callback)

    def caught(self, error: Exception) -> None:
        """Log and count an exception of a callback, and output the safe torque."""
        self.faults += 1
        self.last_fault = f'{type(error).__name__}: {error}'
        where = ''.join(traceback.format_tb(error.__traceback__)[-2:]).strip()
        self.get_logger().error(
            f'a callback failed, the node goes on: {self.last_fault}\n{where}',
            throttle_duration_sec=1.0,
        )
        try:
            self.output_safe_torque()
        except Exception as failed:
            self.get_logger().error(f'no safe torque could be published: {failed}')

    def output_safe_torque(self) -> None:
        """Publish what keeps the robot safe; a node that commands nothing publishes nothing."""

    def _guarded(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return the callback guarded; its second argument, if any, is a service's response."""
        if inspect.iscoroutinefunction(callback):

            @functools.wraps(callback)
            async def awaited(*arguments: Any) -> Any:
                try:
                    return await callback(*arguments)
                except Exception as error:
                    return self._failed(error, arguments)

            return awaited

        @functools.wraps(callback)
        def called(*arguments: Any) -> Any:
            try:
                return callback(*arguments)
            except Exception as error:
                return self._failed(error, arguments)

        return called

    def _failed(self, error: Exception, arguments: tuple[Any, ...]) -> Any:
        self.caught(error)
        if len(arguments) < 2:
            return None
        response = type(arguments[1])()  # the other may be half filled in
        if hasattr(response, 'message'):
            response.message = f'failed: {self.last_fault}'
        return response
