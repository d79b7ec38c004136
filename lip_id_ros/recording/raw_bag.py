"""Serialized messages into a bag, as they come, without decoding them."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path
from types import TracebackType
from typing import Literal

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

BAG_VERSION: Literal[8] = 8  # the newest that Humble reads too


class RawBag:
    """
    A rosbag2 folder (MCAP) being written; to be used in a `with` statement.

    For systems without rosbag2.

    Parameters
    ----------
    path : path
        The folder to be made.
    topics : mapping
        Message type (as package/msg/Name) by topic.

    """

    def __init__(self, path: str | os.PathLike[str], topics: Mapping[str, str]) -> None:
        self._writer = Writer(Path(path), version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP)
        self._topics = topics

    def __enter__(self) -> RawBag:
        """
        Make the folder.

        Raises
        ------
        OSError
            If it exists or cannot be made.

        """
        store = get_typestore(Stores.ROS2_JAZZY)
        self._writer.open()
        self._connections = {
            topic: self._writer.add_connection(topic, kind, typestore=store)
            for topic, kind in self._topics.items()
        }
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the bag."""
        self._writer.close()

    def write(self, topic: str, receive_ns: int, data: bytes) -> None:
        """
        Append a message.

        Parameters
        ----------
        topic : str
            One of the bag's.
        receive_ns : int
            When it came [ns].
        data : bytes
            Serialized (CDR).

        """
        self._writer.write(self._connections[topic], receive_ns, data)
