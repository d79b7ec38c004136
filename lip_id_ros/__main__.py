"""Run the command line with `python -m lip_id_ros`."""

import sys

from lip_id_ros.cli.main import main

if __name__ == '__main__':
    sys.exit(main())
