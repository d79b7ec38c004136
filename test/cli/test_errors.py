"""Bad input: exit status 1, one line on stderr that names the culprit, no file left behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import shutil
from typing import Any
import zipfile

from cli.conftest import Workshop
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.cli import main
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.recording.bag_writer import JointStateTrack, write_bag_folder
from lip_id_ros.simulation import write_bag

Capture = pytest.CaptureFixture[str]
FIT = ('fit', 'SOURCE', '-o', 'out.npz')


def bag(path: Path, **signals: Any) -> None:
    data = swing(1, rate=50.0)
    given = {'position': data.q, 'velocity': data.dq, 'effort': data.tau, **signals}
    write_bag_folder(path, [JointStateTrack('/joint_states', data.joint_names, data.t, **given)])


def npz(path: Path, **arrays: Any) -> None:
    data = swing(1)
    given = {'q': data.q, 'dq': data.dq, 'ddq': data.ddq, 'tau': data.tau, **arrays}
    np.savez(path, **{name: value for name, value in given.items() if value is not None})


def no_topic(path: Path) -> None:
    write_bag(path, swing(1), topic='/joint_states')
    file = path / f'{path.name}.mcap'
    content = file.read_bytes()
    file.write_bytes(content.replace(b'sensor_msgs/msg/JointState', b'sensor_msgs/msg/JointXtate'))
    (path / 'metadata.yaml').unlink()


SOURCES: dict[str, tuple[Callable[[Path], object], str]] = {
    'missing': (lambda path: None, 'SOURCE: No such file or directory'),
    'empty folder': (lambda path: path.mkdir(), r'SOURCE must hold .* files of one bag'),
    'no messages': (lambda path: write_bag_folder(path, []), r'SOURCE .*joint_states'),
    'no effort': (lambda path: bag(path, effort=None), r'SOURCE.* effort'),
    'NaN in effort': (
        lambda path: bag(path, effort=np.full((1000, 3), np.nan)), r'SOURCE.*effort'
    ),
    'NaN in position': (
        lambda path: bag(path, position=np.full((1000, 3), np.nan)), r'SOURCE.*position'
    ),
    'too short': (
        lambda path: write_bag(path, swing(1, duration=0.5)), r'SOURCE must hold a motion of'
    ),
    'still': (
        lambda path: bag(path, effort=np.zeros((1000, 3))), r"'elbow', 'wrist' are the same"
    ),
}  # fmt: skip

ARRAYS: dict[str, tuple[dict[str, Any], str]] = {
    'no torque': ({'tau': None}, 'tau is missing'),
    'few samples': (
        {name: np.random.default_rng(0).normal(size=(4, 3)) for name in ('q', 'dq', 'ddq', 'tau')},
        'at least 10 samples',
    ),
    'object': ({'q': np.array([None, {}], dtype=object)}, 'is not a data set'),
}

SETTINGS: dict[str, tuple[str, str]] = {
    'wrong key': ('fit: {kernal: lip}', "fit.kernal in .*arm.yaml .* did you mean 'kernel'"),
    'not YAML': ('fit: [', 'arm.yaml is not readable YAML'),
    'wrong topic': ('recording: {topic: /elsewhere}', "recording.topic .* not '/elsewhere'"),
    'unknown joint': ('recording: {joints: [knee]}', 'knee'),
    'scale per joint': ('recording: {effort_scale: [1.0, 2.0]}', 'effort_scale .*3'),
}


def failure(arguments: list[str], capsys: Capture) -> str:
    """Return the error of a command: the last line on stderr, the only one but for progress."""
    capsys.readouterr()
    assert main(arguments) == 1
    output = capsys.readouterr()
    assert output.out == ''
    *progress, line = output.err.splitlines()
    assert not any('error' in stage or 'Traceback' in stage for stage in progress)
    assert line.startswith('lip_id: error: ')
    return line


def check(line: str, pattern: str) -> None:
    with pytest.raises(RuntimeError, match=pattern):
        raise RuntimeError(line)


# a data set of a torque that never changes is a data set, but nothing to learn from
CASES = [(verb, name) for name in SOURCES for verb in ('fit', 'dataset')]
CASES.remove(('dataset', 'still'))


@pytest.mark.parametrize(('verb', 'name'), CASES)
def test_recordings(verb: str, name: str, here: Path, capsys: Capture) -> None:
    make, pattern = SOURCES[name]
    make(here / 'SOURCE')
    before = set(here.rglob('*'))

    check(failure([verb, *FIT[1:]], capsys), pattern)

    assert set(here.rglob('*')) == before


@pytest.mark.parametrize('name', ARRAYS)
def test_data_sets(name: str, here: Path, capsys: Capture) -> None:
    arrays, pattern = ARRAYS[name]
    npz(here / 'data.npz', **arrays)

    check(failure(['fit', 'data.npz', '-o', 'out.npz'], capsys), pattern)

    assert list(here.iterdir()) == [here / 'data.npz']


@pytest.mark.parametrize('name', SETTINGS)
def test_settings(name: str, workshop: Workshop, here: Path, capsys: Capture) -> None:
    text, pattern = SETTINGS[name]
    (here / 'arm.yaml').write_text(text)

    line = failure(['fit', str(workshop.bag), '-o', 'out.npz', '--config', 'arm.yaml'], capsys)

    check(line, pattern)
    assert list(here.iterdir()) == [here / 'arm.yaml']


def test_missing_settings_file(workshop: Workshop, here: Path, capsys: Capture) -> None:
    line = failure(['fit', str(workshop.bag), '-o', 'out.npz', '--config', 'no.yaml'], capsys)
    check(line, 'no.yaml: No such file')


def test_a_bag_without_joint_states(here: Path, capsys: Capture) -> None:
    no_topic(here / 'SOURCE')
    check(failure(list(FIT), capsys), r'SOURCE must have a topic of sensor_msgs/msg/JointState')


MODEL_VERBS = (
    ('evaluate', 'MODEL', 'BAG', '--json', 'out.json', '--report', 'report'),
    ('predict', 'MODEL', 'BAG', '-o', 'out.npz'),
)


def damage(path: Path) -> None:
    """Turn a byte of the largest array; those of zip headers may not matter to anyone."""
    with zipfile.ZipFile(path) as archive:
        largest = max(archive.infolist(), key=lambda member: member.compress_size)
    content = bytearray(path.read_bytes())
    content[largest.header_offset + largest.compress_size // 2] ^= 0xFF
    path.write_bytes(content)


def lacking(path: Path) -> None:
    arrays, header = read_npz(path)
    write_npz(path, arrays, {'schema': header['schema'], 'version': header['version']})


@pytest.mark.parametrize('spoil', [damage, lacking, Path.unlink])
@pytest.mark.parametrize('command', MODEL_VERBS, ids=lambda command: command[0])
def test_models(
    command: tuple[str, ...],
    spoil: Callable[[Path], None],
    workshop: Workshop,
    here: Path,
    capsys: Capture,
) -> None:
    (here / 'MODEL').write_bytes(workshop.model.read_bytes())
    spoil(here / 'MODEL')
    before = set(here.iterdir())

    line = failure([str(workshop.bag) if word == 'BAG' else word for word in command], capsys)

    check(line, 'MODEL')
    assert set(here.iterdir()) == before


def test_a_data_set_that_lacks_a_joint(workshop: Workshop, here: Path, capsys: Capture) -> None:
    swing(1).with_joints(('shoulder', 'elbow')).save('data.npz')
    for command in MODEL_VERBS[:2]:
        words = {'MODEL': str(workshop.model), 'BAG': 'data.npz'}
        line = failure([words.get(word, word) for word in command], capsys)
        check(line, 'joint wrist expected in the data set, which has shoulder, elbow; correct')
    assert list(here.iterdir()) == [here / 'data.npz']


def test_a_prediction_in_no_known_format(workshop: Workshop, here: Path, capsys: Capture) -> None:
    line = failure(['predict', str(workshop.model), str(workshop.bag), '-o', 'out.csv'], capsys)
    check(line, 'out.csv must end in .npz, the format of the prediction')
    assert list(here.iterdir()) == []


@pytest.mark.parametrize(
    ('output', 'pattern'),
    [
        ('no/out.npz', r'no/out.npz cannot be written \(No such file or directory\); name an'),
        ('.', r'\. cannot be written \(Is a directory\); name another file, or mend its folder'),
        ('-', "an output must have a name without NUL, but '-' came; name it"),
    ],
)
def test_a_place_that_cannot_be_written_is_found_before_the_work(
    output: str, pattern: str, here: Path, capsys: Capture
) -> None:
    # the source does not exist either: nobody has looked for it yet
    check(failure(['fit', 'SOURCE', '-o', output], capsys), pattern)


def test_a_report_in_the_place_of_a_file(here: Path, capsys: Capture) -> None:
    (here / 'report').write_text('precious')
    line = failure(['evaluate', 'no.npz', 'no_bag', '--report', 'report'], capsys)
    check(line, 'report: Not a directory')


@pytest.mark.slow
def test_where_the_disk_fails_the_old_model_stays_and_the_error_names_the_file(
    workshop: Workshop, here: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    (here / 'out.npz').write_bytes(workshop.model.read_bytes())

    def fail(source: Path, target: Path) -> None:
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr('os.replace', fail)
    fit = ['fit', str(workshop.bag), '-o', 'out.npz', '--config', str(workshop.settings)]
    line = failure([*fit, '--kernel', 'recursive'], capsys)

    check(line, 'out.npz: No space left on device; free that disk')
    assert (here / 'out.npz').read_bytes() == workshop.model.read_bytes()
    assert list(here.iterdir()) == [here / 'out.npz']


@pytest.mark.parametrize(
    ('arguments', 'pattern'),
    [
        (('fit', 'run.mcap', '-o', 'run.mcap'), 'run.mcap is an input and would be replaced'),
        (('fit', 'run.mcap', '-o', 'link.npz'), 'link.npz is an input and would be replaced'),
        (('inspect', 'run.mcap', '--json', 'run.mcap'), 'is an input and would be replaced'),
        (('evaluate', 'm.npz', 'run.mcap', '--json', 'run.mcap'), 'is an input and would'),
        (('predict', 'm.npz', 'run.mcap', '-o', 'm.npz'), 'm.npz is an input and would be'),
        (('predict', 'm.npz', 'run.mcap', '-o', 'other.npz'), 'exists and is not a prediction'),
        (('dataset', 'run.mcap', '-o', 'm.npz'), 'm.npz exists and is not a data set'),
        (('inspect', 'm.npz', '--json', 'letter.csv'), 'letter.csv exists and is not a JSON obj'),
        (('evaluate', 'm.npz', 'run.mcap', '--report', 'photos'), 'photos is not empty and has'),
    ],
)
def test_an_output_never_replaces_an_input_or_a_foreign_file(
    workshop: Workshop, here: Path, capsys: Capture, arguments: tuple[str, ...], pattern: str
) -> None:
    (storage,) = workshop.bag.glob('*.mcap')
    for name in ('run.mcap', 'other.npz'):
        shutil.copy(storage, name)
    shutil.copy(workshop.model, 'm.npz')
    Path('link.npz').symlink_to('run.mcap')
    Path('letter.csv').write_text('Dear all, this is text')
    Path('photos').mkdir()
    Path('photos/a.jpg').write_text('precious')
    before = {path: path.read_bytes() for path in here.rglob('*') if path.is_file()}

    check(failure(list(arguments), capsys), f'{pattern}.*--force')

    assert {path: path.read_bytes() for path in here.rglob('*') if path.is_file()} == before


def test_interruption_is_quiet(
    workshop: Workshop, here: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr('lip_id_ros.evaluation.run', interrupt)
    status = main(['predict', str(workshop.model), str(workshop.bag), '-o', 'out.npz'])

    assert status == 130
    assert capsys.readouterr().err.splitlines()[-1] == 'lip_id: interrupted'
    assert list(here.iterdir()) == []


@pytest.mark.parametrize(
    'arguments',
    [
        ('teach',),
        ('fit', 'bag'),
        ('fit', '-o', 'out.npz'),
        ('fit', 'bag', '-o', 'out.npz', '--kernel', 'magic'),
        ('fit', 'bag', '-o', 'out.npz', '--holdout', '1.5'),
        ('fit', 'bag', '-o', 'out.npz', '--holdout', 'half'),
        ('fit', 'bag', '-o', 'out.npz', '--joints', 'a,,b'),
        ('predict',),
        ('inspect', ''),
        ('fit', '', '-o', 'out.npz'),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...], capsys: Capture) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)

    assert stopped.value.code == 2
    assert 'usage: lip_id' in capsys.readouterr().err


@pytest.mark.parametrize('verb', ['evaluate', 'adapt', 'payload'])
def test_a_recording_in_the_place_of_the_model(
    verb: str, workshop: Workshop, here: Path, capsys: Capture
) -> None:
    line = failure([verb, str(workshop.bag), 'arm.npz'], capsys)
    check(
        line, '.* must be a model that `lip_id fit` wrote, but is a folder; name the model first'
    )


def test_a_log_of_another_arm(workshop: Workshop, here: Path, capsys: Capture) -> None:
    rows = '\n'.join(f'{0.01 * k},{0.1 * k},{0.2 * k}' for k in range(9))
    (here / 'other.csv').write_text(f't,q_lift,tau_lift\n{rows}\n')
    line = failure(['evaluate', str(workshop.model), 'other.csv'], capsys)
    check(line, 'joints .* expected in other.csv, which has lift; correct the names, or give')


def test_a_urdf_is_looked_for_before_recordings_are_read(here: Path, capsys: Capture) -> None:
    check(failure(['fit', 'SOURCE', '-o', 'out.npz', '--urdf', 'no.urdf'], capsys), 'no.urdf: No')
