"""Run a launch file of the package: `python examples/demo/launching.py NAME name:=value ...`."""

from __future__ import annotations

import sys

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import AnyLaunchDescriptionSource


def main(arguments: list[str]) -> int:
    """
    Run a launch file until SIGINT, given its name and ``name:=value`` for its arguments.

    Returns 0 if every node ended well.
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
