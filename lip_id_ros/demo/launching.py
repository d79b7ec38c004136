"""Run a launch file of this package in this process, as ``ros2 launch`` does."""

from __future__ import annotations

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


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
