"""Jobs beside the node `train`: what they report, how they fail, how they end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
import errno
import io
import json
import os
from pathlib import Path
import select
import signal
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from waiting import wait_until

from lip_id_ros.acquisition import job_process
from lip_id_ros.acquisition.job import advanced, in_words, Jobs, JobState, pass_on, SAVING, Task
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import LipIdError
from lip_id_ros.files import SCRATCH
from lip_id_ros.progress import end
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


@pytest.mark.parametrize(
    'line',
    [
        'NumbaWarning: something\n',
        '5',
        'null',
        '"text"',
        '[]',
        '{}',
        '{"progress": 3}',
        '[' * 9999,
    ],
)
def test_what_a_library_prints_changes_nothing(line: str) -> None:
    assert advanced(RUNNING, line) == RUNNING


@pytest.mark.slow
@pytest.mark.usefixtures('strange_modules')
def test_a_data_set_is_made_beside(jobs: Jobs, tmp_path: Path) -> None:
    task = Task('dataset', flatten(Config()), str(tmp_path / 'data.npz'))
    work = jobs.start(task, [samples(500)])
    assert jobs.state.state == 'running'
    with pytest.raises(LipIdError, match=r'^a dataset is running; wait until ~/status shows'):
        jobs.start(task, [samples(500)])
    result = dict(work.result())
    cautions = result.pop('cautions')
    assert cautions[0].startswith('warning short: the recording lasts 4.99 s')
    data = Dataset.load(tmp_path / 'data.npz')
    source = data.provenance['sources'][0]
    assert result == {
        'path': task.path,
        'n_samples': data.n_samples,
        'sources': [{'source': 'the recording', 'samples': 500, 'dropped': source['dropped']}],
        'left_out': [],
        'thinned': 0,
    }
    assert data.joint_names == ('a', 'b')
    assert jobs.state == JobState('dataset', 'done', SAVING, 0, 1, result=work.result())
    jobs.stop()


@pytest.mark.slow
def test_the_end_of_a_job_is_not_that_of_the_next(jobs: Jobs, tmp_path: Path) -> None:
    for name in ('first', 'second'):
        task = Task('dataset', flatten(Config()), str(tmp_path / f'{name}.npz'))
        work = jobs.start(task, [samples(500)])
        wait_until(lambda: jobs.state.state != 'running', 'the end of a job')
        assert jobs.state.state == 'done', jobs.state.error
        assert jobs.state.result['path'] == task.path
    assert work.result()['path'] == task.path
    jobs.stop()


@pytest.mark.slow
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
    with pytest.raises(LipIdError, match=r'^the fit was cancelled\.$'):
        work.result()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_job_can_be_cancelled_and_another_may_follow(jobs: Jobs, tmp_path: Path) -> None:
    with pytest.raises(LipIdError, match=r'^no fit or data set is running\.$'):
        jobs.cancel()
    settings = flatten(Config()) | {'fit.iterations': 10**6, 'fit.subset': 400}
    work = jobs.start(Task('fit', settings, str(tmp_path / 'model.npz')), [samples(500)])
    assert jobs.cancel() == 'fit'
    with pytest.raises(LipIdError, match=r'^the fit was cancelled\.$'):
        work.result()
    assert jobs.state.state == 'cancelled'
    assert list(tmp_path.iterdir()) == []
    path = str(tmp_path / 'data.npz')
    assert (
        jobs.start(Task('dataset', flatten(Config()), path), [samples(500)]).result()['path']
        == path
    )
    jobs.stop()


def test_a_job_that_saves_already_is_not_called_cancelled(
    jobs: Jobs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / 'data.npz'
    os.mkfifo(path)  # the process waits in the middle of its result
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    os.set_blocking(reader, True)
    content: list[bytes] = []

    def end_and_read(process: subprocess.Popen[str], is_spared: Callable[[], bool]) -> None:
        process.terminate()
        with open(reader, 'rb') as file:
            content.append(file.read())
        end(process, is_spared)

    monkeypatch.setattr('lip_id_ros.acquisition.job.end', end_and_read)
    monkeypatch.setattr('lip_id_ros.acquisition.job.STOP_SECONDS', 60.0)  # a busy machine
    random = np.random.default_rng(0).normal(size=(20_000, 2))  # more than a pipe holds
    recorded = replace(samples(20_000), effort=random)
    jobs.start(Task('dataset', flatten(Config()), str(path)), [recorded])
    wait_until(lambda: select.select([reader], [], [], 0.0)[0], 'the begin of the result')
    with pytest.raises(LipIdError, match=r'^it is too late to cancel the dataset; ~/status'):
        jobs.cancel()
    assert jobs.state.state == 'done'
    (tmp_path / 'copy.npz').write_bytes(content[0])
    assert Dataset.load(tmp_path / 'copy.npz').n_samples == jobs.state.result['n_samples']
    monkeypatch.undo()
    jobs.stop()


def test_a_job_that_saves_for_long_is_neither_cancelled_nor_killed(
    jobs: Jobs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('lip_id_ros.progress.STOP_SECONDS', 0.2)
    monkeypatch.setattr('lip_id_ros.acquisition.job.STOP_SECONDS', 0.2)
    path = tmp_path / 'data.npz'
    os.mkfifo(path)  # a slow disk: the process waits in the middle of its result
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), 'rb') as reader:
        os.set_blocking(reader.fileno(), True)
        random = np.random.default_rng(0).normal(size=(20_000, 2))  # more than a pipe holds
        recorded = replace(samples(20_000), effort=random)
        work = jobs.start(Task('dataset', flatten(Config()), str(path)), [recorded])
        wait_until(lambda: select.select([reader], [], [], 0.0)[0], 'the begin of the result')
        with pytest.raises(LipIdError, match=r'^it is too late to cancel the dataset; ~/status'):
            jobs.cancel()
        assert jobs.state.state == 'running'
        (tmp_path / 'copy.npz').write_bytes(reader.read())
    assert work.result()['path'] == str(path)
    assert Dataset.load(tmp_path / 'copy.npz').n_samples == work.result()['n_samples']
    jobs.stop()


@pytest.mark.slow
def test_a_fit_of_torques_that_no_arm_makes_shows_its_progress_and_can_be_cancelled(
    jobs: Jobs, tmp_path: Path
) -> None:
    random = replace(samples(1000), effort=np.random.default_rng(0).normal(size=(1000, 2)))
    work = jobs.start(Task('fit', flatten(Config()), str(tmp_path / 'model.npz')), [random])
    shown: set[tuple[str, int]] = set()

    def progressed() -> bool:
        shown.add((jobs.state.stage, jobs.state.done))
        return len({stage for stage, _ in shown}) > 2 and jobs.state.total > 0

    wait_until(progressed, 'the progress of the fit')
    jobs.cancel()
    with pytest.raises(LipIdError, match=r'^the fit was cancelled\.$'):
        work.result()
    assert jobs.state.state == 'cancelled'
    assert list(tmp_path.iterdir()) == []
    jobs.stop()


KILLED = """
import os, signal
from lip_id_ros.acquisition.job import Jobs, Task

Jobs._follow = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
Jobs().start(Task('fit', {}, 'model.npz'), []).result()
"""


@pytest.mark.slow
def test_samples_of_a_killed_node_are_removed_by_the_next(
    jobs: Jobs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / 'temporary'
    place.mkdir()
    command, environment = [sys.executable, '-c', KILLED], os.environ | {'TMPDIR': str(place)}
    assert subprocess.run(command, env=environment, check=False).returncode == -signal.SIGKILL
    (left,) = place.glob(f'{SCRATCH}*')
    monkeypatch.setattr('tempfile.tempdir', str(place))
    monkeypatch.setattr('lip_id_ros.files.SWEEP_AFTER_S', -1.0)
    task = Task('dataset', flatten(Config()), str(tmp_path / 'data.npz'))
    assert jobs.start(task, [samples(500)]).result()['path'] == task.path
    assert not left.exists()
    jobs.stop()


def test_samples_that_cannot_be_passed_on_stay_and_a_sentence_has_the_reason(
    jobs: Jobs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*arguments: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr('lip_id_ros.acquisition.job._write', full)
    work = jobs.start(Task('dataset', flatten(Config()), str(tmp_path / 'd.npz')), [samples(500)])
    sentence = r'^the samples must be written to .* but cannot be \(No space left on device\);'
    with pytest.raises(LipIdError, match=sentence):
        work.result()
    assert jobs.state.state == 'failed'
    jobs.stop()


def run_job(
    kind: str, folder: Path, path: Path, recorded: JointSamples | None = None, **values: object
) -> dict[str, Any]:
    pass_on(folder, [recorded or samples(1000)])
    cheap = {'fit.subset': 30, 'fit.max_samples': 60, 'fit.iterations': 3, 'fit.kernel': 'lip'}
    settings = flatten(Config()) | cheap
    request = {**asdict(Task(kind, settings, str(path))), 'recording': str(folder), **values}
    output = io.StringIO()
    assert job_process.main(io.StringIO(json.dumps(request)), output) == 0, output.getvalue()
    result: dict[str, Any] = json.loads(output.getvalue().splitlines()[-1])['result']
    return result


def test_the_last_share_is_held_out(tmp_path: Path) -> None:
    (tmp_path / 'samples').mkdir()
    result = run_job('fit', tmp_path / 'samples', tmp_path / 'model.npz', holdout=0.2)
    assert result['holdout']['n_samples'] == pytest.approx(0.2 * result['n_samples'], abs=1)


def test_a_model_that_explains_nothing_is_warned_of(tmp_path: Path) -> None:
    (tmp_path / 'samples').mkdir()
    random = replace(samples(1000), effort=np.random.default_rng(0).normal(size=(1000, 2)))
    result = run_job('fit', tmp_path / 'samples', tmp_path / 'model.npz', random)
    assert any('hardly better than the mean' in sentence for sentence in result['cautions'])


def test_held_out_samples_that_are_not_explained_are_warned_of(tmp_path: Path) -> None:
    (tmp_path / 'samples').mkdir()
    recorded = samples(1000)
    effort = np.array(recorded.effort)
    effort[700:] = np.random.default_rng(0).normal(size=(300, 2))
    changed = replace(recorded, effort=effort)
    result = run_job('fit', tmp_path / 'samples', tmp_path / 'model.npz', changed, holdout=0.3)
    assert any('hardly better than the mean' in sentence for sentence in result['cautions'])


def test_a_result_that_cannot_be_written_is_an_error_of_its_file(tmp_path: Path) -> None:
    request, output = tmp_path / 'samples', io.StringIO()
    request.mkdir()
    pass_on(request, [samples(1000)])
    asked = Task('dataset', flatten(Config()), str(tmp_path / 'gone' / 'data.npz'))
    content = json.dumps({**asdict(asked), 'recording': str(request)})
    assert job_process.main(io.StringIO(content), output) == 1
    error = json.loads(output.getvalue().splitlines()[-1])['error']
    assert (
        error == f'{tmp_path / "gone" / "data.npz"}: No such file or directory; correct the path.'
    )


@pytest.mark.slow
def test_a_request_may_be_longer_than_an_argument(jobs: Jobs, tmp_path: Path) -> None:
    """As with a robot description of a whole robot: an argument has 128 kB at most."""
    settings = flatten(Config()) | {'fit.description': f'<robot><!--{"x" * 300_000}--></robot>'}
    work = jobs.start(Task('fit', settings, str(tmp_path / 'model.npz')), [samples(500)])
    with pytest.raises(LipIdError, match=r"^joint 'a' of the data is not among the joints that"):
        work.result()
    jobs.stop()


def test_sources_are_named_in_words() -> None:
    assert in_words(300, []) == '300 samples'
    assert in_words(300, ['a.mcap', 'b.bag']) == '300 samples and a.mcap, b.bag'
    assert in_words(0, ['a.mcap']) == 'a.mcap'
