"""Run launch files of this package, as ``ros2 launch`` does, in this process or in another."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import AnyLaunchDescriptionSource


def main(arguments: list[str]) -> int:
    """
    Run until SIGINT.

    Parameters
    ----------
    arguments : list of str
        Name of a launch file, then ``name:=value`` for each of its arguments.

    Returns
    -------
    int
        Exit status: 0 if every node ended well.

    """
    name, *given = arguments
    path = get_package_share_path('lip_id_ros') / 'launch' / name
    included = IncludeLaunchDescription(
        AnyLaunchDescriptionSource(str(path)),
        launch_arguments=[pair.split(':=', 1) for pair in given],
    )
    service = LaunchService(argv=given)
    service.include_launch_description(LaunchDescription([included]))
    status: int = service.run()
    return status


LAUNCH_FILE = 'demo.launch.py'
STOP_SECONDS = 15.0


@contextmanager
def launched(output: Path) -> Iterator[subprocess.Popen[bytes]]:
    """
    Run the demo's launch file while the block runs.

    Parameters
    ----------
    output : Path
        Folder of the model and the data; the nodes' log goes there too.

    """
    with open(output / 'nodes.log', 'wb') as log:
        process = subprocess.Popen(
            [sys.executable, '-m', 'lip_id_ros.demo.launching', LAUNCH_FILE, f'output:={output}'],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            yield process
        finally:
            end(process)


def end(process: subprocess.Popen[bytes]) -> None:
    """Interrupt a process and its children, as Ctrl-C does; kill what is left."""
    for number in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, number)
            try:
                process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                continue


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
