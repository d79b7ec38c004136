"""Settings: declared once, checked wherever they come from, documented from the same table."""

from __future__ import annotations

from array import array
from dataclasses import dataclass
from pathlib import Path
import re
from typing import Any

import numpy as np
import pytest

from lip_id_ros.errors import ConfigError
from lip_id_ros.settings import (
    build,
    Config,
    example_yaml,
    FitSettings,
    flat_rows,
    flatten,
    override,
    PreprocessingSettings,
    read_config,
    RecordingSettings,
    setting,
    Settings,
)

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Example(Settings):
    switch: bool = setting(True, 'A switch.')
    count: int = setting(3, 'A count.', minimum=1, maximum=9)
    rate: float = setting(2.0, 'A rate.', unit='Hz', minimum=0.0, old_name='frequency')
    mode: str = setting(
        'fast', 'A mode.', choices=('fast', 'slow'), old_values={'off': 'slow', 'False': 'slow'}
    )
    names: tuple[str, ...] = setting((), 'Names.')
    gains: tuple[float, ...] = setting((), 'Gains.', minimum=0.0)


@pytest.fixture
def config_file(tmp_path: Path) -> Path:
    return tmp_path / 'robot.yaml'


@pytest.mark.parametrize(
    ('name', 'value', 'expected'),
    [
        ('switch', 1, 'true or false'),
        ('count', 2.0, 'a whole number >= 1 and <= 9'),
        ('count', 10, 'a whole number >= 1 and <= 9'),
        ('rate', '2 Hz', 'a number >= 0 Hz'),
        ('rate', -0.1, 'a number >= 0 Hz'),
        ('rate', float('nan'), 'a number >= 0 Hz'),
        ('mode', 'medium', 'a text fast or slow'),
        ('names', 'joint_1', 'a list of texts'),
        ('names', [1], 'a list of texts'),
        ('gains', [1.0, -1.0], 'a list of numbers >= 0'),
    ],
)
def test_wrong_value_is_refused_everywhere(name: str, value: object, expected: str) -> None:
    sentence = re.escape(f'Example.{name} must be {expected}, not {value!r}.')
    with pytest.raises(ConfigError, match=f'^{sentence}$'):
        Example(**{name: value})  # type: ignore[arg-type]
    sentence = re.escape(f'part.{name} in somewhere must be {expected}, not {value!r}.')
    with pytest.raises(ConfigError, match=f'^{sentence}$'):
        build(Example, {name: value}, 'part', 'somewhere')


@pytest.mark.parametrize(
    ('values', 'sentence'),
    [
        ({'frequency': 1.0}, r'^part\.frequency in a file is called rate now; rename it\.$'),
        ({'mode': 'off'}, r"must be a text fast or slow, not 'off'; write slow\.$"),
        ({'mode': False}, r'must be a text fast or slow, not False; write slow\.$'),
    ],
)
def test_an_old_name_or_word_is_refused_with_the_new_one(
    values: dict[str, object], sentence: str
) -> None:
    with pytest.raises(ConfigError, match=sentence):
        build(Example, values, 'part', 'a file')


def test_values_take_the_type_of_their_setting() -> None:
    example = build(
        Example,
        {'rate': 4, 'names': ['a', 'b'], 'gains': array('d', [1.0, 2.0])},
        'part',
        'somewhere',
    )
    assert example == Example(rate=4.0, names=('a', 'b'), gains=(1.0, 2.0))
    assert isinstance(example.rate, float)
    assert isinstance(example.names, tuple)


def test_numbers_and_arrays_of_numpy_are_taken() -> None:
    example = Example(
        count=np.int64(4),  # type: ignore[arg-type]
        rate=np.float32(2.5),  # type: ignore[arg-type]
        gains=np.array([1, 2]),  # type: ignore[arg-type]
    )
    assert example == Example(count=4, rate=2.5, gains=(1.0, 2.0))
    assert type(example.count) is int
    assert type(example.rate) is float
    with pytest.raises(ConfigError, match=r'cutoff_hz must be a number .* not array\(\['):
        PreprocessingSettings(cutoff_hz=np.array([1.0, 2.0]))  # type: ignore[arg-type]


def test_every_setting_has_a_description_and_an_allowed_default() -> None:
    for key, documented in flat_rows(Config()):
        assert documented.description.endswith('.'), key
        assert documented.check(documented.default, key) == documented.default


def test_read_config_keeps_defaults_for_what_is_not_named(config_file: Path) -> None:
    config_file.write_text(
        'recording:\n  joints: [a, b]\n  effort_scale: [1, -2.5]\n'
        'preprocessing: {cutoff_hz: 1e1}\n'
    )
    assert read_config(config_file) == Config(
        recording=RecordingSettings(joints=('a', 'b'), effort_scale=(1.0, -2.5)),
        preprocessing=PreprocessingSettings(cutoff_hz=10.0),
    )


def test_empty_file_means_defaults(config_file: Path) -> None:
    config_file.write_text('# nothing yet\n')
    assert read_config(config_file) == Config()


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('fit: {kernal: lip}', r"fit.kernal in .*robot.yaml is not a setting; .* 'kernel'\?$"),
        ('fits: {}', r"fits in .*robot.yaml is not a setting; did you mean 'fit'\?$"),
        ('zzz: {}', r'zzz in .* is not a setting; known are recording, preprocessing, fit.$'),
        ('1: {}', r'1 in .* is not a setting; known are recording, preprocessing, fit.$'),
        (
            'fit: {kernel: rbf}',
            r'fit.kernel in .*robot.yaml must be a text articulated or lip or recursive, '
            r"not 'rbf'.$",
        ),
        ('fit: {seed: 1.5}', r'fit.seed in .*robot.yaml must be a whole number >= 0, not 1.5.$'),
        ('recording: {topic: }', r'recording.topic in .* must be a text, not None.$'),
        ('fit: 3', r'robot.yaml must hold settings under \'fit\' as "name: value", not 3.$'),
        ('[1, 2]', r'robot.yaml must hold sections as "name: value", not \[1, 2\].$'),
        ('fit: {', r'robot.yaml is not readable YAML \(.*\); correct it there.$'),
        ('fit: {seed: 1, seed: 2}', r"robot.yaml is not readable YAML \('seed' comes twi"),
    ],
)
def test_wrong_file_gives_one_sentence(config_file: Path, text: str, sentence: str) -> None:
    config_file.write_text(text)
    with pytest.raises(ConfigError, match=sentence) as caught:
        read_config(config_file)
    assert '\n' not in str(caught.value)


def test_override_by_flat_names() -> None:
    config = override(Config(), {'fit.kernel': 'lip', 'recording.joints': ['a']}, 'the parameters')
    assert config.fit == FitSettings(kernel='lip')
    assert config.recording.joints == ('a',)
    again = override(config, {'fit.seed': 4}, 'the command line')
    assert again.fit == FitSettings(kernel='lip', seed=4)


@pytest.mark.parametrize(
    ('key', 'sentence'),
    [
        ('fit.sed', r"fit.sed in the parameters is not a setting; did you mean 'seed'\?$"),
        ('seed', r'seed in the parameters is not a setting; known are recording, '),
    ],
)
def test_override_refuses_unknown_names(key: str, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        override(Config(), {key: 1}, 'the parameters')


def test_flatten_is_the_inverse_of_override() -> None:
    config = Config(fit=FitSettings(seed=7), recording=RecordingSettings(effort_scale=(2.0,)))
    assert override(Config(), flatten(config), 'a copy') == config


def test_example_yaml_reads_back(config_file: Path) -> None:
    config = Config(fit=FitSettings(kernel='lip'), recording=RecordingSettings(joints=('a', 'b')))
    config_file.write_text(example_yaml(config))
    assert read_config(config_file) == config


def test_documented_example_in_the_repository_is_up_to_date() -> None:
    current = (ROOT / 'config' / 'fit.yaml').read_text()
    assert current == example_yaml(Config()), 'write example_yaml(Config()) into config/fit.yaml'


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('fit: {seed: ' + '9' * 5000 + '}', 'is not readable YAML'),
        ('fit: ' + '[' * 3000 + ']' * 3000, 'is not readable YAML'),
        ('a: &x [1]\nb: *x', 'is not readable YAML .an alias'),
        ('recording: {effort_scale: [1e308]}', r'recording\.effort_scale in .* <= 1e\+09'),
        ('preprocessing: {cutoff_hz: 1' + '0' * 400 + '}', 'cutoff_hz in .* must be a number'),
        ('#' * 1_000_001, 'more than 1000000 bytes'),
        ('\udcff', 'is not readable YAML'),
    ],
)
def test_hostile_settings_are_refused(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / 'fit.yaml'
    path.write_text(text, errors='surrogateescape')
    with pytest.raises(ConfigError, match=sentence) as caught:
        read_config(path)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize('section', [{'seed': 1}, RecordingSettings()])
def test_sections_of_another_type_are_refused(section: Any) -> None:
    with pytest.raises(ConfigError, match=r'^Config\.fit must be FitSettings, not .*; write FitS'):
        Config(fit=section)
