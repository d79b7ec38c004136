"""
Nodes as forks of one process that has imported what they import, which takes most of their start.

`python forked.py IN OUT` reads requests from one descriptor and answers on the other, a line each.
"""

from __future__ import annotations

import atexit
from collections.abc import Mapping
from contextlib import suppress
from importlib import import_module
import json
import os
from pathlib import Path
import runpy
import signal
import subprocess
import sys
import threading
from typing import Any, IO

NODES = ('adapt', 'excite', 'monitor', 'serve', 'train')
PRELOADED = (*(f'lip_id_ros.nodes.{name}' for name in NODES), 'examples.demo.launching')


class Fork:
    """One process, with the part of `subprocess.Popen` that tests use."""

    def __init__(self, server: ForkServer, pid: int) -> None:
        self._server, self.pid = server, pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        if self.returncode is None:
            self.returncode = self._server.ask({'poll': self.pid})
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class ForkServer:
    """The process that forks, from its first request on; it ends with this one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._requests: IO[str]
        self._answers: IO[str]

    def fork(
        self, module: str, arguments: list[str], log: Path, environment: Mapping[str, str]
    ) -> Fork:
        """Run a module as `python -m` does, in the folder of its log."""
        request = {'module': module, 'arguments': arguments, 'log': str(log)}
        return Fork(self, self.ask({**request, 'environment': dict(environment)}))

    def ask(self, request: Mapping[str, Any]) -> Any:
        with self._lock:
            if self._process is None:
                self._begin()
            self._requests.write(json.dumps(request) + '\n')
            self._requests.flush()
            return json.loads(self._answers.readline())

    def _begin(self) -> None:
        theirs, requests = os.pipe()
        answers, own = os.pipe()
        tests = Path(__file__).resolve().parents[1]
        paths = os.pathsep.join([str(tests.parent), os.environ.get('PYTHONPATH', ''), str(tests)])
        self._process = subprocess.Popen(
            [sys.executable, __file__, str(theirs), str(own)],
            pass_fds=(theirs, own),
            env={**os.environ, 'PYTHONPATH': paths},
        )
        os.close(theirs)
        os.close(own)
        self._requests, self._answers = os.fdopen(requests, 'w'), os.fdopen(answers)
        atexit.register(self._end, self._process)

    def _end(self, process: subprocess.Popen[bytes]) -> None:
        self._requests.close()
        process.wait()


def serve_requests(requests: IO[str], answers: IO[str]) -> dict[str, Any] | None:
    """Answer requests until there are no more; in a fork, return its request."""
    running: set[int] = set()
    for line in requests:
        request = json.loads(line)
        if 'poll' in request:
            (pid, status), answer = os.waitpid(request['poll'], os.WNOHANG), None
            if pid:
                running.discard(pid)
                answer = os.waitstatus_to_exitcode(status)
        else:
            answer = os.fork()
            if not answer:
                return dict(request)
            running.add(answer)
        answers.write(json.dumps(answer) + '\n')
        answers.flush()
    for left in running:
        with suppress(ProcessLookupError):
            os.kill(left, signal.SIGKILL)
    return None


def become(request: Mapping[str, Any]) -> None:
    """Take on what a process of its own would have been started with."""
    log = os.open(request['log'], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for number in (1, 2):
        os.dup2(log, number)
    os.close(log)
    os.environ.clear()
    os.environ.update(request['environment'])
    sys.path[0] = str(Path(request['log']).parent)
    os.chdir(sys.path[0])
    sys.argv = [request['module'], *request['arguments']]
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)


def main() -> int:
    for number in (signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)  # Ctrl-C is for the tests, which then end this
    for module in PRELOADED:
        import_module(module)
    requests, answers = os.fdopen(int(sys.argv[1])), os.fdopen(int(sys.argv[2]), 'w')
    request = serve_requests(requests, answers)
    if request is None:
        return 0
    requests.close()
    answers.close()
    become(request)
    sys.modules.pop(request['module'], None)  # it is run, and what it imports is there
    runpy.run_module(request['module'], run_name='__main__', alter_sys=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
