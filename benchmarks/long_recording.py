"""Peak memory of `inspect`, `dataset` and `fit` on a recording of very many messages."""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rosbags.typesys import get_typestore, Stores

from lip_id_ros.arrays import Array
from lip_id_ros.recording.bag_writer import RawBag

JOINT_STATE, TOPIC = 'sensor_msgs/msg/JointState', '/joint_states'
N_JOINTS = 7
RATE_HZ = 1000
BATCH = 10_000
MOST_MB = 1000.0


def main(arguments: list[str]) -> int:
    """Write a bag, run the verbs on it, print a table; fail where one takes 1 GB or more."""
    parser = argparse.ArgumentParser(prog='benchmarks long_recording', description=__doc__)
    parser.add_argument('--messages', type=int, default=10_000_000)
    parser.add_argument('--folder', type=Path, help='of the bag, which is deleted afterwards')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    parser.add_argument('--kernel', default='articulated', help='of the fit')
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        bag = Path(folder) / 'bag'
        write(bag, options.messages)
        size = sum(file.stat().st_size for file in bag.iterdir()) / 1e9
        model = str(Path(folder) / 'model.npz')
        verbs = {
            'inspect': ['inspect', str(bag), '--json', str(Path(folder) / 'inspect.json')],
            'dataset': ['dataset', str(bag), '-o', str(Path(folder) / 'data.npz')],
            'fit': ['fit', *(str(bag), '-o', model, '--kernel', options.kernel)],
        }
        rows = [{'verb': name, **measured(verb, folder)} for name, verb in verbs.items()]
    _print(rows, options.messages, size)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return int(any(row['code'] != 0 or row['peak_mb'] >= MOST_MB for row in rows))


def write(path: Path, count: int) -> None:
    """Write a bag of so many JointStates of an arm that moves at 1 kHz."""
    content, places = template()
    with RawBag(path, {TOPIC: JOINT_STATE}) as bag:
        for begin in range(0, count, BATCH):
            numbers = np.arange(begin, min(begin + BATCH, count))
            messages = np.tile(np.frombuffer(content, np.uint8), (numbers.size, 1))
            time_ns = numbers * (10**9 // RATE_HZ)
            stamps = np.column_stack([time_ns // 10**9, time_ns % 10**9]).astype('<u4')
            messages[:, 4:12] = stamps.view(np.uint8)
            for place, values in zip(places, motion(numbers / RATE_HZ), strict=True):
                messages[:, place : place + 8 * N_JOINTS] = values.view(np.uint8)
            for receive_ns, message in zip(time_ns.tolist(), messages, strict=True):
                bag.write(TOPIC, receive_ns, message.tobytes())


def motion(t: Array) -> tuple[Array, Array, Array]:
    """Return positions, velocities and efforts of single pendulums, each on its own."""
    joint = np.arange(N_JOINTS)
    rate = 1.0 + 0.37 * joint
    slow = 0.11 + 0.013 * joint
    phase, drift = np.outer(t, rate) + joint, np.outer(t, slow)
    q = np.sin(phase) + np.sin(drift)
    dq = rate * np.cos(phase) + slow * np.cos(drift)
    ddq = -(rate**2) * np.sin(phase) - slow**2 * np.sin(drift)
    return q, dq, 2.0 * ddq + 10.0 * np.sin(q) + dq + np.tanh(20.0 * dq)


_LAUNCHER = """
import os, sys
silent = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
pid = os.posix_spawn(sys.executable, sys.argv[1:], os.environ, file_actions=silent)
_, status, usage = os.wait4(pid, 0)
print(os.waitstatus_to_exitcode(status), usage.ru_maxrss)
"""
"""Starts a process from a small one: a process counts the memory of its parent as its own."""


def measured(verb: list[str], folder: str) -> dict[str, Any]:
    """Run `lip_id`; return exit code, seconds and the most memory of any of its processes."""
    started = time.perf_counter()
    command = [sys.executable, '-m', 'lip_id_ros', *verb]
    ran = subprocess.run(
        [sys.executable, '-c', _LAUNCHER, *command],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        env=os.environ | {'TMPDIR': folder},
    )
    code, peak_kb = map(int, ran.stdout.split())
    return {'code': code, 'seconds': time.perf_counter() - started, 'peak_mb': peak_kb / 1e3}


def template() -> tuple[bytes, list[int]]:
    """Return a message, and where its positions, velocities and efforts are."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    stamp = types['builtin_interfaces/msg/Time'](sec=0, nanosec=0)
    arrays = [np.full(N_JOINTS, value) for value in (1.5, 2.5, 3.5)]
    message = types[JOINT_STATE](
        types['std_msgs/msg/Header'](stamp=stamp, frame_id=''),
        [f'joint{number + 1}' for number in range(N_JOINTS)],
        *arrays,
    )
    data = bytes(store.serialize_cdr(message, JOINT_STATE))
    return data, [data.index(array.tobytes()) for array in arrays]


def _print(rows: list[dict[str, Any]], messages: int, size_gb: float) -> None:
    table = Table(title=f'{messages} messages of {N_JOINTS} joints, {size_gb:.1f} GB')
    for heading in ('verb', 'peak [MB]', 's', 'exit code'):
        table.add_column(heading, justify='left' if heading == 'verb' else 'right')
    for row in rows:
        table.add_row(
            row['verb'], f'{row["peak_mb"]:.0f}', f'{row["seconds"]:.0f}', str(row['code'])
        )
    Console().print(table)
