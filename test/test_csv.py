"""Logs as CSV files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from preprocessing.motions import recording, uniform
import pytest

from lip_id_ros.errors import DataError, LipIdError, SourceError
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import describe, preprocess
from lip_id_ros.recording.reading import read_log

NAMELESS = "a column '{}' .* must end in the name of its"

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
    assert samples.counts == {
        'value not finite': 1,
        'effort empty where others have it': 1,
        'stamp repeated': 1,
    }
    np.testing.assert_array_equal(samples.t, [0.0, 1.0, 3.0])
    np.testing.assert_array_equal(samples.position[:, 0], [1.0, 1.0, 4.0])


@pytest.mark.parametrize(
    ('text', 'error', 'sentence'),
    [
        ('', DataError, r'^the first line of .*log.csv must name the columns, .* is .*; add such'),
        ('0,1,2\n1,1,2\n', DataError, r"^the first line .* but is '0,1,2'; add such a line"),
        ('t,q_a,q_a\n', DataError, r"^the columns of .* must have different names, but 'q_a' com"),
        ('t,q_a,tau_a\n', DataError, r'must hold rows of numbers, but has none; record some'),
        ('t,q_a,tau_a\n0,1\n', DataError, r'^line 2 of .* must have 3 cells .* but has 2;'),
        ('t,q_a,tau_a\n0,1,x\n', DataError, r"^tau_a in line 2 of .* must be a number, not 'x';"),
        ('t,q_a,tau_a\n0,1,\n', DataError, r"^tau_a in line 2 of .* must be a number, not '';"),
        ('q_a,tau_a\n0,1\n', DataError, r'must have the columns t, q_NAME, .* but t is missing'),
        ('t,a,tau_a\n0,1,1\n', DataError, r'must have the columns .* but q_NAME is missing'),
        ('t,q_a,tau_a\n0,nan,1\n', SourceError, r'^no row of .* can be used \(value not finite:'),
        ('t,q_a,tau_a\n0,1,2\n1,x,2\n2,1,2\n3,1', DataError, r"^q_a in line 3 .* not 'x'; corre"),
        ('t,q_a,tau_a\n0,1,2\n1,1_000,2\n2,1,2\n', DataError, r"^q_a in line 3 .* not '1_000'"),
        ('t,q_a,tau_a\n0,1,2\n1,１２,2\n2,1,2\n', DataError, r"^q_a in line 3 .* not '１２'"),
        ('t,q_a,dq_a,tau_a,q_\n0,1,2,3,4\n', DataError, NAMELESS.format('q_')),
        ('t,q_a,dq_a,tau_a,dq_\n0,1,2,3,4\n', DataError, NAMELESS.format('dq_')),
        ('t,q_a,dq_a,tau_a,tau_\n0,1,2,3,4\n', DataError, NAMELESS.format('tau_')),
        (
            ',t,q_b,tau_b\n0.5,0,1,2\n0.6,1,1,2\n',
            DataError,
            r'no name and begins with 0\.5, 0\.6;',
        ),
        (
            't,q_a,effort_a\n0,1,2\n',
            DataError,
            r'must have tau_a \[N m\] beside q_a \[rad\], but has effort_a; name',
        ),
        ('t,q_a_deg,tau_a\n0,1,2\n', DataError, r'must have tau_a_deg .* but has tau_a; name'),
        ('t,q_a_deg,torque_a\n0,1,2\n', DataError, r'must have tau_a_deg .* but has torque_a;'),
    ],
)
def test_sentence_for_a_file_that_cannot_be_used(
    tmp_path: Path, text: str, error: type[LipIdError], sentence: str
) -> None:
    with pytest.raises(error, match=sentence):
        load_dataset(log(tmp_path / 'log.csv', text))


def test_sentence_for_a_file_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / 'log.csv').write_bytes(b'\xff\xfe\x00\x01' * 20)
    with pytest.raises(DataError, match=r'log.csv must be a text of numbers and commas, but is'):
        load_dataset(tmp_path / 'log.csv')


def test_accelerations_are_left_aside_and_noted(tmp_path: Path) -> None:
    samples = read_log(log(tmp_path / 'log.csv', 't,q_a,ddq_a,tau_a\n0,1,9,2\n1,1,9,2\n'))
    assert samples.notes == ('accelerations were not read; they are computed from the positions',)


def test_real_log(shared_data: Path, tmp_path: Path) -> None:
    """The KUKA log, given a column of time: its columns are named as documented."""
    lines = (shared_data / 'kuka_lbr_med7' / 'measurements.csv').read_text().splitlines()
    timed = [f't,{lines[0]}', *(f'{number / 100},{line}' for number, line in enumerate(lines[1:]))]
    data = load_dataset(log(tmp_path / 'log.csv', '\n'.join(timed)))
    assert data.joint_names == ('0', '1', '2', '3', '4', '5', '6')
    assert data.n_samples > 200


@pytest.mark.parametrize('rest', ['0.05', '5,4.2,', '5,4.2,3e'])
def test_last_line_that_was_cut_short_is_left_out(tmp_path: Path, rest: str) -> None:
    text = 't,q_a,tau_a\n' + ''.join(f'{k / 100},{k},1\n' for k in range(6107)) + rest
    samples = read_log(log(tmp_path / 'log.csv', text))
    assert samples.n_samples == 6107
    assert samples.notes == ('line 6109, the last one, was cut short and left out',)


TABLE = 't,q_a,dq_a,tau_a\n0,1.5,2,-3\n0.25,2.5,2,4e-1\n0.5,3.5,2,5\n'
LINES = TABLE.splitlines()
WRITTEN_OTHERWISE = {
    'semicolons': TABLE.replace(',', ';'),
    'decimal commas': TABLE.replace(',', ';').replace('.', ','),
    'tabs': TABLE.replace(',', '\t'),
    'blanks': '\n'.join(f' {line}  '.replace(',', '   ') for line in LINES) + '\n',
    'delimiters at the ends': TABLE.replace('\n', ';\n').replace(',', ';'),
    'names in a comment': f'# {TABLE}',
    'comments before': f'% logger 3\n#\n\n{TABLE}',
    'comments between': TABLE.replace('\n0.25', '\n# contact\n0.25'),
    'names in a comment, blanks': f'# {TABLE}'.replace(',', ' '),
    'numbered lines': f',{LINES[0]}\n' + ''.join(f'{k},{x}\n' for k, x in enumerate(LINES[1:])),
}


@pytest.mark.parametrize('kind', WRITTEN_OTHERWISE)
def test_tables_of_other_programs_are_read(tmp_path: Path, kind: str) -> None:
    samples = read_log(log(tmp_path / 'log.csv', WRITTEN_OTHERWISE[kind]))
    assert samples.joint_names == ('a',)
    np.testing.assert_array_equal(samples.t, [0.0, 0.25, 0.5])
    np.testing.assert_array_equal(samples.position[:, 0], [1.5, 2.5, 3.5])
    np.testing.assert_array_equal(samples.effort[:, 0], [-3.0, 0.4, 5.0])


@pytest.mark.parametrize('kind', WRITTEN_OTHERWISE)
def test_tables_of_other_programs_may_be_cut_short(tmp_path: Path, kind: str) -> None:
    text = WRITTEN_OTHERWISE[kind].rstrip()
    for end in (len(text) - 2, len(text) - 4):
        samples = read_log(log(tmp_path / 'log.csv', text[:end]))
        assert samples.n_samples == 2
        assert 'was cut short and left out' in samples.notes[0]


def test_an_effort_for_some_joints_only_is_refused(tmp_path: Path) -> None:
    """The positions q_d_a may be desired ones; the log seemed to have no efforts at all."""
    path = log(tmp_path / 'log.csv', 't,q_a,q_d_a,dq_a,tau_a\n0,1,1,2,3\n1,1,1,2,3\n')
    sentence = (
        r'^.*log.csv must have an effort for every position, but tau_d_a is missing; add it, or '
        r'choose joints with recording.joints.$'
    )
    with pytest.raises(DataError, match=sentence):
        read_log(path)
    assert read_log(path, ('a',)).has_velocity


def test_velocities_of_some_joints_only_are_noted(tmp_path: Path) -> None:
    samples = read_log(log(tmp_path / 'log.csv', 't,q_a,q_b,dq_a,tau_a,tau_b\n0,1,1,2,3,4\n'))
    assert not samples.has_velocity
    assert samples.notes == ('velocities were not read, since dq_b is missing',)


@pytest.mark.parametrize('start', [1.7e12, 1.7e15, 1.7e18])
def test_times_that_are_not_in_seconds_are_refused(tmp_path: Path, start: float) -> None:
    text = 't,q_a,tau_a\n' + ''.join(f'{start + k},{k},1\n' for k in range(30))
    with pytest.raises(SourceError, match=r't in .*log.csv must be in seconds, but is 1.7e\+'):
        read_log(log(tmp_path / 'log.csv', text))


def test_a_log_of_positions_alone_is_read(tmp_path: Path) -> None:
    assert not read_log(log(tmp_path / 'a.csv', 't,q_a\n0,1\n1,1\n2,3\n')).has_effort
