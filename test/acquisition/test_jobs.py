"""Jobs beside the node `train`: what they report, how they fail, how they end."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lip_id_ros.acquisition.job import advanced, in_words, JobState, Task
from lip_id_ros.acquisition.jobs import Jobs
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import LipIdError
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import Config, flatten

RUNNING = JobState('fit', 'running', 'start')


def samples(n_samples: int) -> JointSamples:
    t = 0.01 * np.arange(n_samples, dtype=np.float64)
    q = np.sin(np.outer(t, [1.0, 2.0]))
    return JointSamples(t, q, np.gradient(q, t, axis=0), 3.0 * q, ('a', 'b'))


@pytest.fixture
def jobs() -> Jobs:
    return Jobs()


@pytest.mark.parametrize(
    ('content', 'expected'),
    [
        (
            {'progress': ['hyperparameters', 3, 60]},
            JobState('fit', 'running', 'hyperparameters', 3, 60),
        ),
        ({'result': {'path': 'm'}}, JobState('fit', 'done', 'start', result={'path': 'm'})),
        ({'error': 'too few.'}, JobState('fit', 'failed', 'start', error='too few.')),
    ],
)
def test_each_line_advances_the_state(content: object, expected: JobState) -> None:
    assert advanced(RUNNING, json.dumps(content)) == expected


def test_what_a_library_prints_changes_nothing() -> None:
    assert advanced(RUNNING, 'NumbaWarning: something\n') == RUNNING


def test_a_data_set_is_made_beside(jobs: Jobs, tmp_path: Path) -> None:
    task = Task('dataset', flatten(Config()), str(tmp_path / 'data.npz'), niceness=1)
    work = jobs.start(task, [samples(500)])
    assert jobs.state.state == 'running'
    with pytest.raises(LipIdError, match=r'^a dataset is running; wait until ~/status shows'):
        jobs.start(task, [samples(500)])
    result = dict(work.result())
    findings = result.pop('findings')
    assert findings[0].startswith('warning short: the recording lasts 4.99 s')
    data = Dataset.load(tmp_path / 'data.npz')
    source = data.provenance['sources'][0]
    assert result == {
        'path': task.path,
        'n_samples': data.n_samples,
        'sources': [{'source': 'the recording', 'samples': 500, 'dropped': source['dropped']}],
        'left_out': [],
    }
    assert data.joint_names == ('a', 'b')
    assert jobs.state == JobState('dataset', 'done', 'start', result=work.result())
    jobs.stop()


def test_a_failure_is_one_sentence_and_leaves_no_file(jobs: Jobs, tmp_path: Path) -> None:
    task = Task('fit', flatten(Config()), str(tmp_path / 'absent' / 'model.npz'))
    with pytest.raises(LipIdError) as failed:
        jobs.start(task, [samples(3)]).result()
    assert jobs.state.state == 'failed'
    assert jobs.state.error == str(failed.value)
    assert '\n' not in jobs.state.error
    assert list(tmp_path.iterdir()) == []
    jobs.stop()


def test_a_job_ends_with_its_owner(jobs: Jobs, tmp_path: Path) -> None:
    settings = flatten(Config()) | {'fit.iterations': 10**6, 'fit.subset': 400}
    work = jobs.start(Task('fit', settings, str(tmp_path / 'model.npz')), [samples(500)])
    jobs.stop()
    with pytest.raises(LipIdError, match=r'^the process of the fit ended with status -15\.$'):
        work.result()
    assert list(tmp_path.iterdir()) == []


def test_sources_are_named_in_words() -> None:
    assert in_words(300, []) == '300 samples'
    assert in_words(300, ['a.mcap', 'b.bag']) == '300 samples and a.mcap, b.bag'
    assert in_words(0, ['a.mcap']) == 'a.mcap'
