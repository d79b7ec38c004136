"""Parameters of `train` that do not go together are refused with a sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lip_id_ros.acquisition.settings import (
    check_together,
    OUTPUTS,
    require_writable,
    train_parameters,
)
from lip_id_ros.errors import ConfigError

DEFAULTS = {name: row.default for name, row in train_parameters().items()}


@pytest.mark.parametrize(
    ('values', 'sentence'),
    [
        (
            {'recording.joints': ('a', 'b', 'a')},
            "recording.joints must name each joint once, but 'a' comes twice.",
        ),
        (
            {'recording.joints': ('a', 'b'), 'recording.effort_scale': (1.0,)},
            'recording.effort_scale must have one value for each of the 2 recording.joints, not '
            '1; complete it, or leave it empty.',
        ),
        (
            {'recording.joints': ('a', 'b'), 'recording.joint_types': ('revolute',) * 3},
            'recording.joint_types must have one value for each of the 2 recording.joints, not '
            '3; complete it, or leave it empty.',
        ),
        (
            {'bags': ('/absent/bag',)},
            'bags must be recordings or data sets, but /absent/bag does not exist; correct the '
            'path, which is relative to the folder in which the node was started.',
        ),
        (
            {'bags': ('x' * 300,)},
            f'bags must be recordings or data sets, but {"x" * 300} does not exist; correct the '
            'path, which is relative to the folder in which the node was started.',
        ),
        (
            {'bags': ('',)},
            'bags must be recordings or data sets, but an empty path does not exist; correct the '
            'path, which is relative to the folder in which the node was started.',
        ),
        (
            {'payload_path': './model.npz'},
            'payload_path must name a file of its own, but ./model.npz is model_path; change one '
            'of them.',
        ),
        (
            {'payload_model_path': 'model.npz'},
            'payload_model_path must name a file of its own, but model.npz is model_path; change '
            'one of them.',
        ),
        (
            {'bags': ('/dev/null',), 'dataset_path': '/dev/null'},
            'dataset_path must name a file of its own, but /dev/null is one of the bags; change '
            'one of them.',
        ),
    ],
)
def test_contradictions_are_refused(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ConfigError) as refused:
        check_together({**DEFAULTS, **values})
    assert str(refused.value) == sentence


def test_what_goes_together_is_taken(tmp_path: Path) -> None:
    check_together(DEFAULTS)
    lists = {'recording.effort_scale': (1.0, -2.0), 'recording.effort_offset': (0.0, 1.0)}
    check_together({**DEFAULTS, **lists})  # as many joints as the first message has
    check_together({**DEFAULTS, **lists, 'recording.joints': ('a', 'b'), 'bags': (str(tmp_path),)})


def test_a_path_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    for name in ('model_path', 'unsaved_path'):
        require_writable(name, str(tmp_path / 'model.npz'))
        for path, sentence in (
            ('', f'{name} must name a file, but is empty'),
            (
                str(tmp_path),
                rf'{name}: {tmp_path} cannot be written \(Is a directory\); name anoth',
            ),
            ('x' * 300, rf'{name}: x+ cannot be written \(File name too long\)'),
            (str(tmp_path / 'absent' / 'm.npz'), r'absent/m.npz cannot be written \(No such file'),
        ):
            with pytest.raises(ConfigError, match=sentence):
                require_writable(name, path)


def test_a_data_set_of_another_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r'^dataset_path: .*data.csv must end in .npz, the form'):
        require_writable('dataset_path', str(tmp_path / 'data.csv'))


@pytest.mark.parametrize('name', OUTPUTS)
def test_a_file_of_another_kind_is_not_replaced(name: str, tmp_path: Path) -> None:
    for other in ('letter.txt', 'recording.csv', 'model.npz'):
        (tmp_path / other).write_text('precious')
        with pytest.raises(ConfigError, match=rf'^{name}: .*{other} exists and is not a'):
            require_writable(name, str(tmp_path / other))
