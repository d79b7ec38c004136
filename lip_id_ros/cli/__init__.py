"""The command line: one module per verb, which calls and prints but does not compute."""

from lip_id_ros.cli.main import main

__all__ = ['main']
