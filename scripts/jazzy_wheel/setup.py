"""The programs that an installed ROS 2 Jazzy has and its PyPI wheel has not."""

from setuptools import setup

setup(
    name='lip-id-ros-jazzy-wheel',
    version='1.0.0',
    py_modules=['ros2_launch'],
    entry_points={
        'console_scripts': [
            'ros2 = ros2cli.cli:main',
            '_ros2_daemon = ros2cli.daemon:main',
            'launch_test = launch_testing.launch_test:main',
        ],
        'ros2cli.command': ['launch = ros2_launch:LaunchCommand'],
    },
)
