"""
The process beside the node `train` that turns a recording into a data set and a model.

Started by `Job`; its one argument is a JSON request, what it prints are JSON lines.

"""

from __future__ import annotations

import json
import os
import sys
from typing import Any, TextIO

from lip_id_ros.config import Config, override
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation import with_inertia_check
from lip_id_ros.gp import fit
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.progress import Progress
from lip_id_ros.runtime.recording_file import take_over


def main(arguments: list[str], output: TextIO) -> int:
    """
    Do what the request asks.

    Parameters
    ----------
    arguments : list of str
        The request of `lip_id_ros.runtime.job.Job` as one JSON text.
    output : text stream
        Gets one JSON object per line: `progress` (stage, done, total), then `result` or `error`.

    Returns
    -------
    int
        Exit status.

    """
    request = json.loads(arguments[0])
    os.nice(request['niceness'])
    try:
        result = _work(request, _reporter(output))
    except (LipIdError, OSError) as error:
        _emit(output, {'error': str(error)})
        return 1
    _emit(output, {'result': result})
    return 0


def _work(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    config = override(Config(), request['settings'], 'the parameters')
    samples = take_over(request['recording'])
    dataset = preprocess(samples, config.preprocessing, config.recording)
    result: dict[str, Any] = {'path': request['path'], 'n_samples': dataset.n_samples}
    if request['kind'] == 'dataset':
        dataset.save(request['path'])
        return result
    model = with_inertia_check(fit(dataset, config.fit, progress))
    model.save(request['path'])
    return {**result, 'summary': model.summary}


def _reporter(output: TextIO) -> Progress:
    def report(stage: str, done: int, total: int) -> None:
        _emit(output, {'progress': [stage, done, total]})

    return report


def _emit(output: TextIO, content: dict[str, Any]) -> None:
    output.write(json.dumps(content) + '\n')
    output.flush()


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:], sys.stdout))
