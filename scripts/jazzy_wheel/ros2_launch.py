"""`ros2 launch` for a ROS 2 Jazzy that comes without the package ros2launch."""

import argparse
from pathlib import Path
import sys

from ament_index_python.packages import get_package_share_directory, PackageNotFoundError
from launch import LaunchContext, LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import AnyLaunchDescriptionSource
from ros2cli.command import CommandExtension


class LaunchCommand(CommandExtension):
    """Run a launch file."""

    def add_arguments(self, parser: argparse.ArgumentParser, cli_name: str) -> None:
        """Take PACKAGE FILE or PATH, then arguments for the launch file."""
        parser.add_argument('-d', '--debug', action='store_true', help='say more')
        parser.add_argument(
            '-s', '--show-args', action='store_true', help='list the arguments of the launch file'
        )
        parser.add_argument('package', metavar='PACKAGE or PATH')
        parser.add_argument('rest', nargs='*', metavar='FILE or NAME:=VALUE')

    def main(self, *, parser: argparse.ArgumentParser, args: argparse.Namespace) -> int:
        """Run it, or list its arguments."""
        names = [word for word in args.rest if ':=' not in word]
        arguments = [word for word in args.rest if ':=' in word]
        source = AnyLaunchDescriptionSource(str(launch_file(args.package, names)))
        if args.show_args:
            return show_arguments(source)
        service = LaunchService(
            argv=arguments, debug=args.debug, noninteractive=not sys.stdin.isatty()
        )
        pairs = [tuple(word.split(':=', 1)) for word in arguments]
        include = IncludeLaunchDescription(source, launch_arguments=pairs)
        service.include_launch_description(LaunchDescription([include]))
        return service.run()


def launch_file(package: str, names: list[str]) -> Path:
    """Find the launch file that the words on the command line name."""
    if not names:
        path = Path(package)
        if path.is_file():
            return path
        raise RuntimeError(f'no launch file {path}; give PACKAGE FILE or the path of a file')
    if len(names) > 1:
        raise RuntimeError(f'{names[1]!r} is no NAME:=VALUE')
    try:
        share = Path(get_package_share_directory(package))
    except PackageNotFoundError as error:
        raise RuntimeError(f'package {package!r} not found; source its environment') from error
    found = sorted(path for path in share.rglob(names[0]) if path.is_file())
    if not found:
        raise RuntimeError(f'{names[0]} not found under {share}')
    return found[0]


def show_arguments(source: AnyLaunchDescriptionSource) -> int:
    """Print name, description and default of every argument of a launch file."""
    context = LaunchContext(noninteractive=True)
    print('Arguments (pass as NAME:=VALUE):')
    for argument in source.get_launch_description(context).get_launch_arguments():
        print(f"\n    '{argument.name}':\n        {argument.description}")
        if argument.default_value is not None:
            text = ''.join(part.perform(context) for part in argument.default_value)
            print(f'        (default: {text!r})')
    return 0
