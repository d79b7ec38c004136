"""Data sets and logs as CSV files."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from preprocessing.motions import recording, uniform
import pytest

from lip_id_ros.dataset import check_suffix, Dataset
from lip_id_ros.errors import ConfigError, DataError, LipIdError, SourceError
from lip_id_ros.preprocessing import describe, load_dataset, preprocess
from lip_id_ros.recording.csv_log import read_log
from lip_id_ros.settings import Config, RecordingSettings

T = uniform(300, 100.0)
DATA = preprocess(recording(T))


def log(path: Path, text: str) -> Path:
    path.write_text(text, encoding='utf-8')
    return path


def recorded(path: Path, signals: str = 'q dq tau') -> Path:
    samples = recording(T)
    arrays = {'q': samples.position, 'dq': samples.velocity, 'tau': samples.effort}
    names = [f'{signal}_{joint}' for signal in signals.split() for joint in samples.joint_names]
    columns = np.column_stack([T, *(arrays[signal] for signal in signals.split())])
    np.savetxt(path, columns, delimiter=',', header=','.join(['t', *names]), comments='')
    return path


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=8, max_size=8))
def test_every_number_reads_back_exactly(
    tmp_path_factory: pytest.TempPathFactory, numbers: list[float]
) -> None:
    values = np.array(numbers).reshape(4, 2)
    data = Dataset(
        t=np.array([0.0, 0.1, 0.0, 0.1]),
        q=values,
        dq=-values,
        ddq=values[::-1],
        tau=values,
        joint_names=('left arm, 1', 'tau_"x"'),
        joint_types=('revolute', 'revolute'),
        segment=np.array([0, 0, 3, 3]),
        tau_noiseless=values,
        kinetic=values[:, 0],
    )
    path = tmp_path_factory.mktemp('csv') / 'data.csv'
    data.save(path)
    again = Dataset.load(path)
    for name in ('t', 'segment', 'q', 'dq', 'ddq', 'tau', 'tau_noiseless', 'kinetic'):
        np.testing.assert_array_equal(getattr(again, name), getattr(data, name), err_msg=name)
    assert again.joint_names == data.joint_names
    assert again.potential is None


def test_a_data_set_is_a_source(tmp_path: Path) -> None:
    path = tmp_path / 'data.csv'
    DATA.save(path)
    data = load_dataset(path)
    np.testing.assert_array_equal(data.ddq, DATA.ddq)
    settings = RecordingSettings(
        joints=('elbow', 'shoulder'),
        joint_types=('prismatic', 'revolute'),
        gravity_compensated=True,
    )
    data = load_dataset(path, Config(recording=settings))
    np.testing.assert_array_equal(data.q, DATA.q[:, ::-1])
    assert data.joint_types == ('prismatic', 'revolute')
    assert data.gravity_compensated
    assert describe(path)['kind'] == 'data set'


def test_a_log_is_prepared_like_a_bag(tmp_path: Path) -> None:
    data = load_dataset(recorded(tmp_path / 'log.csv'))
    np.testing.assert_allclose(data.ddq, DATA.ddq, atol=1e-9)
    assert data.provenance['sources'][0]['source'] == str(tmp_path / 'log.csv')
    (described,) = describe(tmp_path / 'log.csv')['recordings']
    assert described['joints'] == ['shoulder', 'elbow']
    assert described['timing']['rate_hz'] == pytest.approx(100.0)


def test_a_log_may_lack_velocities_and_have_other_columns(tmp_path: Path) -> None:
    path = recorded(tmp_path / 'log.csv', 'q tau')
    lines = path.read_text().splitlines()
    extra = [f'{lines[0]},tau_ext_elbow', *(f'{line},7' for line in lines[1:])]
    samples = read_log(log(path, '\n'.join(extra)), ('elbow',))
    assert samples.joint_names == ('elbow',)
    assert not samples.has_velocity
    np.testing.assert_allclose(samples.effort[:, 0], recording(T).effort[:, 1])


def test_rows_that_cannot_be_used_are_counted(tmp_path: Path) -> None:
    text = '\ufefft, q_a, tau_a\n0,1,2\n\n1,nan,2\n1,1,2\n1,1,2\n2,1,inf\n3,4,5\n'
    samples = read_log(log(tmp_path / 'log.csv', text))
    assert samples.counts == {'value not finite': 2, 'stamp repeated': 1}
    np.testing.assert_array_equal(samples.t, [0.0, 1.0, 3.0])
    np.testing.assert_array_equal(samples.position[:, 0], [1.0, 1.0, 4.0])


@pytest.mark.parametrize(
    ('text', 'error', 'sentence'),
    [
        ('', DataError, r'^the first line of .*log.csv must name the columns, .* is .*; add such'),
        ('0,1,2\n1,1,2\n', DataError, r"^the first line .* but is '0,1,2'; add such a line"),
        ('t,q_a,q_a\n', DataError, r"^the columns of .* must have different names, but 'q_a' com"),
        ('t,q_a,tau_a\n', DataError, r'must hold rows of numbers, but has none; record some'),
        (
            't,q_a,tau_a\n0,1\n',
            DataError,
            r'^line 2 of .* must have 3 cells .* but has 2; correct',
        ),
        (
            't,q_a,tau_a\n0,1,x\n',
            DataError,
            r"^tau_a in line 2 of .* must be a number, not 'x'; c",
        ),
        (
            't,q_a,tau_a\n0,1,\n',
            DataError,
            r"^tau_a in line 2 of .* must be a number, not ''; cor",
        ),
        (
            'q_a,tau_a\n0,1\n',
            DataError,
            r'must have the columns t, q_NAME, .* but t is missing be',
        ),
        (
            't,a,tau_a\n0,1,1\n',
            DataError,
            r'must have the columns .* but q_NAME is missing beside',
        ),
        (
            't,q_a,ddq_a\n0,1,1\n',
            DataError,
            r'must have the columns .* but dq_a is missing beside',
        ),
        ('t,q_a,dq_a,ddq_a,tau_a\n1,1,1,1,nan\n', DataError, r'^in .*log.csv, tau'),
        (
            't,q_a,tau_a\n0,nan,1\n',
            SourceError,
            r'^no row of .* can be used \(value not finite: 1',
        ),
    ],
)
def test_sentence_for_a_file_that_cannot_be_used(
    tmp_path: Path, text: str, error: type[LipIdError], sentence: str
) -> None:
    with pytest.raises(error, match=sentence):
        load_dataset(log(tmp_path / 'log.csv', text))


def test_sentence_for_a_file_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / 'log.csv').write_bytes(b'\xff\xfe\x00\x01' * 20)
    with pytest.raises(
        DataError, match=r'log.csv must be a text of numbers and commas, but is no'
    ):
        load_dataset(tmp_path / 'log.csv')


def test_sentence_for_an_unknown_ending() -> None:
    with pytest.raises(ConfigError, match=r'^data.txt must end in .npz or .csv, which chooses'):
        check_suffix('data.txt')


def test_real_log(shared_data: Path, tmp_path: Path) -> None:
    """The KUKA log, given a column of time: its columns are named as documented."""
    lines = (shared_data / 'kuka_lbr_med7' / 'measurements.csv').read_text().splitlines()
    timed = [f't,{lines[0]}', *(f'{number / 100},{line}' for number, line in enumerate(lines[1:]))]
    data = load_dataset(log(tmp_path / 'log.csv', '\n'.join(timed)))
    assert data.joint_names == ('0', '1', '2', '3', '4', '5', '6')
    assert data.n_samples > 200
