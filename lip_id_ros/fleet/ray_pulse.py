"""
Whether a Ray cluster still answers.

Where the process of a machine's node or of the cluster's head dies, Ray waits for ever or ends
this process without an exception. So both are asked whether somebody listens.

"""

from __future__ import annotations

import socket
from typing import Any

from lip_id_ros.errors import FitError

INTERVAL_S, PATIENCE_S = 1.0, 10.0
"""How often the cluster is asked where nothing else comes, and for how long it may be silent."""

CLIENT = 'ray://'


class RayPulse:
    """
    Addresses of a cluster that answered when it was joined.

    `ray`: the module, connected. `address`: that it was connected to, if any.

    """

    def __init__(self, ray: Any, address: str | None) -> None:
        self._places = [each for each in _places(ray, address) if _answers(each)]

    def require(self) -> None:
        """Return where all of them still answer; FitError otherwise."""
        for place in self._places:
            if not _answers(place):
                raise FitError(
                    f'the Ray cluster was expected to answer until the fit is done, but nobody '
                    f'listens at {place} any more, perhaps for want of memory; start it anew and '
                    'fit again, with fewer --jobs or the engine local, from what the cache has.'
                )


def _places(ray: Any, address: str | None) -> list[str]:
    """Return host and port of the client's server, or of the head and this machine's node."""
    if address is not None and address.startswith(CLIENT):
        return [address.removeprefix(CLIENT)]
    context = ray.get_runtime_context()
    own = [each for each in ray.nodes() if each['NodeID'] == context.get_node_id()]
    nodes = [f'{each["NodeManagerAddress"]}:{each["NodeManagerPort"]}' for each in own]
    return [context.gcs_address, *nodes]


def _answers(place: str) -> bool:
    host, _, port = place.rpartition(':')
    try:
        socket.create_connection((host.strip('[]'), int(port)), PATIENCE_S).close()
    except (OSError, ValueError):
        return False
    return True
