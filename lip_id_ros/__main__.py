"""
The programs of the package: `python -m lip_id_ros` is `lip_id`.

Where Ctrl-C comes while they are imported, they end without a traceback:
imports take seconds. The command line or the node sets what signals do while it runs.
"""

from __future__ import annotations

from functools import partial
from importlib import import_module
import signal
import sys


def _run(module: str, function: str = 'main') -> int:
    handler = signal.getsignal(signal.SIGINT)
    if handler is signal.default_int_handler:  # of a job in the background it is ignored
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    main = getattr(import_module(f'lip_id_ros.{module}'), function)
    signal.signal(signal.SIGINT, handler)
    status: int = main()
    return status


lip_id = partial(_run, 'cli')
train = partial(_run, 'nodes.train')
serve = partial(_run, 'nodes.serve')
monitor = partial(_run, 'nodes.monitor')
adapt = partial(_run, 'nodes.adapt')
excite = partial(_run, 'nodes.excite')
simulated_panda = partial(_run, 'demo.nodes', 'simulated_panda')

if __name__ == '__main__':
    sys.exit(lip_id())
