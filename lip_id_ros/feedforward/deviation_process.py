"""
Standard deviations of torques, in a process of their own.

The triangular solve of a query takes milliseconds, in which LAPACK holds the interpreter: beside
the answers of `serve` it would delay them. Raw doubles come on standard input, 3 n of them for
each query, and n go out; before the first, n zeros say that the model is ready.

"""

from __future__ import annotations

import sys
from typing import BinaryIO

import numpy as np

from lip_id_ros.model import TrainedModel
from lip_id_ros.serving import Predictor


def main(path: str, queries: BinaryIO, answers: BinaryIO) -> int:
    """
    Answer queries until their stream ends.

    Parameters
    ----------
    path : str
        The model's file.
    queries, answers : binary streams
        Of doubles: q, dq, ddq; standard deviations of tau [N m or N].

    Returns
    -------
    int
        Exit status.

    """
    predictor = Predictor(TrainedModel.load(path))
    n = predictor.n_joints
    predictor.standard_deviation(*np.zeros((3, 1, n)))  # factorises
    answers.write(np.zeros(n).tobytes())
    answers.flush()
    while len(query := queries.read(3 * n * 8)) == 3 * n * 8:
        state = np.frombuffer(query).reshape(3, 1, n)
        answers.write(predictor.standard_deviation(*state).tau.tobytes())
        answers.flush()
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1], sys.stdin.buffer, sys.stdout.buffer))
