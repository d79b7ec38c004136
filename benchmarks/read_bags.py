"""Speed and memory of reading: JointStates of a 7-joint arm in one MCAP, beside a camera."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_typestore, Stores

from benchmarks.long_recording import JOINT_STATE, N_JOINTS, template
from lip_id_ros.recording import read_bag
from lip_id_ros.recording.bag_writer import RawBag

IMAGE = 'sensor_msgs/msg/CompressedImage'
JOINTS, CAMERA = '/joint_states', '/camera'
STEP_NS = 1_000_000
IMAGE_EVERY = 33


def main(arguments: list[str]) -> int:
    """Write a bag, read it in processes of their own, print a table."""
    parser = argparse.ArgumentParser(prog='benchmarks read_bags', description=__doc__)
    parser.add_argument('--messages', type=int, default=1_000_000)
    parser.add_argument('--camera-mb', type=int, default=0, help='size of the other topic')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    parser.add_argument('--read', nargs=2, metavar=('HOW', 'FILE'), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.read:
        how, file = options.read
        print(json.dumps(READERS[how](Path(file))))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'bag'
        write(path, options.messages, options.camera_mb)
        rows = [in_process(how, path) for how in READERS]
    _print(rows, options.messages)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return 0


def write(path: Path, count: int, camera_mb: int) -> None:
    """Write a bag of so many JointStates, and images that sum up to about so many megabytes."""
    first, places = template()
    message, rng = np.frombuffer(first, np.uint8).copy(), np.random.default_rng(0)
    stamp = message[4:12].view('<u4')
    values = [message[place : place + 8 * N_JOINTS] for place in places]
    image = rng.bytes(camera_mb * 10**6 * IMAGE_EVERY // max(count, 1))
    with RawBag(path, {JOINTS: JOINT_STATE, CAMERA: IMAGE}) as bag:
        for number in range(count):
            time_ns = number * STEP_NS
            stamp[:] = divmod(time_ns, 10**9)
            phase = np.sin(1e-3 * number + np.arange(N_JOINTS))
            for part in values:
                part[:] = phase.view(np.uint8)
            bag.write(JOINTS, time_ns, message.tobytes())
            if image and number % IMAGE_EVERY == 0:
                bag.write(CAMERA, time_ns, image)


def in_process(how: str, path: Path) -> dict[str, Any]:
    """Read the bag in a fresh process; return seconds, peak memory and messages."""
    ran = subprocess.run(
        [sys.executable, '-m', 'benchmarks', 'read_bags', '--read', how, str(path)],
        capture_output=True,
        text=True,
        check=True,
    )
    figures: dict[str, Any] = json.loads(ran.stdout)
    return {'reader': how, **figures}


def ours(path: Path) -> dict[str, Any]:
    """Read into arrays."""
    before, started = peak_mb(), time.perf_counter()
    samples = read_bag(path)
    seconds = time.perf_counter() - started
    expected = np.sin(1e-3 * np.arange(samples.n_samples))
    np.testing.assert_array_equal(samples.effort[:, 0], expected)
    return _figures(seconds, before, samples.n_samples)


def library(path: Path) -> dict[str, Any]:
    """Iterate with rosbags, nothing decoded."""
    before, started = peak_mb(), time.perf_counter()
    with Reader(path) as reader:
        wanted = [each for each in reader.connections if each.topic == JOINTS]
        count = sum(1 for _ in reader.messages(wanted))
    return _figures(time.perf_counter() - started, before, count)


def library_decoded(path: Path) -> dict[str, Any]:
    """Iterate with rosbags and decode every message, keeping none."""
    store = get_typestore(Stores.ROS2_JAZZY)
    before, started = peak_mb(), time.perf_counter()
    count = 0
    with Reader(path) as reader:
        wanted = [each for each in reader.connections if each.topic == JOINTS]
        for connection, _, data in reader.messages(wanted):
            store.deserialize_cdr(data, connection.msgtype)
            count += 1
    return _figures(time.perf_counter() - started, before, count)


READERS = {
    'lip_id to arrays': ours,
    'rosbags bare': library,
    'rosbags decoded': library_decoded,
}


def peak_mb() -> float:
    """Return the most memory that this process held so far [MB]; Linux."""
    status = Path('/proc/self/status').read_text(encoding='ascii')
    (line,) = (line for line in status.splitlines() if line.startswith('VmHWM'))
    return int(line.split()[1]) / 1e3


def _figures(seconds: float, before_mb: float, messages: int) -> dict[str, Any]:
    return {
        'messages': messages,
        'seconds': seconds,
        'per_second': messages / seconds,
        'peak_mb': peak_mb(),
        'before_mb': before_mb,
    }


def _print(rows: list[dict[str, Any]], messages: int) -> None:
    bare = next(row['seconds'] for row in rows if row['reader'] == 'rosbags bare')
    table = Table(title=f'{messages} JointStates of {N_JOINTS} joints, MCAP')
    for name in ('reader', 's', 'messages/s', 'times bare', 'peak MB', 'before MB'):
        table.add_column(name, justify='left' if name == 'reader' else 'right')
    for row in rows:
        table.add_row(
            row['reader'],
            f'{row["seconds"]:.1f}',
            f'{row["per_second"]:.0f}',
            f'{row["seconds"] / bare:.2f}',
            f'{row["peak_mb"]:.0f}',
            f'{row["before_mb"]:.0f}',
        )
    Console().print(table)
