"""Storage files of bags, read as far as they can be: MCAP, sqlite3, ROS 1."""

from lip_id_ros.recording.storage.contents import Channel, DamageError, Storage
from lip_id_ros.recording.storage.opening import (
    files_of,
    is_storage,
    open_storage,
    storage_suffix,
    SUFFIXES,
)

__all__ = [
    'SUFFIXES',
    'Channel',
    'DamageError',
    'Storage',
    'files_of',
    'is_storage',
    'open_storage',
    'storage_suffix',
]
