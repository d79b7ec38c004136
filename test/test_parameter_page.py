"""docs/reference/parameters.md says what the tables say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from lip_id_ros.acquisition.settings import fit_values, own_values, train_parameters, TrainSettings
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.settings import ExcitationConfig
from lip_id_ros.feedforward.settings import require_changeable, ServeSettings
from lip_id_ros.settings import Config, flat_rows, flatten, override, parameters_of
from scripts import parameter_page

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'reference' / 'parameters.md'


def test_the_page_is_current(capsys: pytest.CaptureFixture[str]) -> None:
    parameter_page.main()
    written = capsys.readouterr().out
    assert PAGE.read_text(encoding='utf-8') == written, f'run {parameter_page.COMMAND}'


def test_every_parameter_has_one_line() -> None:
    lines = parameter_page.page().splitlines()
    names = [line.split('`')[1] for line in lines if line.startswith('| `')]
    assert names == [name for table in parameter_page.node_parameters().values() for name in table]
    assert (
        '| `recording.effort_offset` | double array | `[]` | >= -1e+09 and <= 1e+09 | N m or N | '
        'at the next fit or data set | Added to the scaled effort, per joint; empty for 0. |'
    ) in lines


def test_every_parameter_is_described_and_allows_its_default() -> None:
    for table in (train_parameters(), parameters_of(ServeSettings)):
        for name, row in table.items():
            assert row.description.endswith('.'), name
            assert row.check(row.default, name) == row.default


def test_no_word_is_one_that_yaml_turns() -> None:
    """`range_policy: off` was False to the parser of parameter files."""
    turned = {'y', 'n', 'yes', 'no', 'on', 'off', 'true', 'false', 'null', '~', ''}
    tables = [*parameter_page.node_parameters().values(), dict(flat_rows(ExcitationConfig()))]
    words = {word for table in tables for row in table.values() for word in row.choices}
    assert len(words) > 30
    assert not {word for word in words if word.lower() in turned}


def test_parameters_of_train_make_its_settings_and_those_of_a_fit() -> None:
    values = {name: row.default for name, row in train_parameters().items()}
    assert TrainSettings(**own_values(values)) == TrainSettings()
    assert override(Config(), fit_values(values), 'the parameters') == Config()
    assert set(flatten(Config())) <= set(values)


def test_parameters_of_serve_make_its_settings() -> None:
    values = {name: row.default for name, row in parameters_of(ServeSettings).items()}
    assert ServeSettings(**values) == ServeSettings()


def test_a_change_without_effect_is_refused() -> None:
    before = ServeSettings()
    for state in ('inactive', 'active'):
        with pytest.raises(ConfigError, match=r'^publish_std is read when the node is configured'):
            require_changeable(before, replace(before, publish_std=True), state)
    require_changeable(before, replace(before, publish_std=True), 'unconfigured')
    require_changeable(before, replace(before, torque_limits=(1.0,)), 'active')
