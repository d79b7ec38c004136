"""
Compile what a first fit, evaluation and query need, into the cache beside the sources.

A small demonstration calls all of it: compiled code depends on the types of its arguments, not on
the number of joints or samples.

"""

from pathlib import Path
import tempfile

from examples.demo.offline import demonstrate, Size
from lip_id_ros.settings import Config, FitSettings

SMALL = Config(fit=FitSettings(subset=30, max_samples=60, iterations=2))

if __name__ == '__main__':
    with tempfile.TemporaryDirectory() as folder:
        demonstrate(Path(folder), Size(n_joints=2, duration=25.0), SMALL)
