"""Whatever a public function gets that it cannot use is refused with one sentence."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from evaluation.models import small_model, training
import numpy as np
import pytest

import lip_id_ros as lip

LIMITS = lip.ExcitationConfig(
    lip.MotionSettings(lower=(-1.0,), upper=(1.0,), velocity=(1.0,)),
    search=lip.SearchSettings(draws=1),
)
PLAN = lip.Plan(training().joint_names, np.arange(2.0), np.zeros((3, 2, 3)))
MASKED = np.ma.masked_array(np.zeros((4, 3), int), mask=np.eye(4, 3, dtype=bool))
STRANGE = {
    'none': None,
    'text': 'text',
    'complex': 1j,
    'object': object(),
    'mapping': {},
    'masked': MASKED,
    'shape': np.zeros((2, 2, 2), int),
    'rows': [[1.0], [1.0, 2.0]],
}
ARRAYS = ('q', 'dq', 'ddq', 'tau')
STATES = ('q', 'dq', 'ddq')


def calls() -> dict[str, Callable[[Any], object]]:
    data, some = training(), np.zeros((4, 3))
    found: dict[str, Callable[[Any], object]] = {
        'check_plan model': lambda value: lip.check_plan(value, PLAN, (1.0,)),
        'check_plan plan': lambda value: lip.check_plan(small_model(), value, (1.0,)),
        'check_plan limits': lambda value: lip.check_plan(small_model(), PLAN, value),
        'design_motion': lip.design_motion,
        'design_motion urdf': partial(lip.design_motion, None),
        'design_motion model': lambda value: lip.design_motion(None, None, value),
        'design_motion targets': partial(lip.design_motion, LIMITS, None, small_model()),
        'load_dataset': lip.load_dataset,
        'load_dataset settings': partial(lip.load_dataset, 'run.csv'),
        'read_config': lip.read_config,
        'read_plans': lip.read_plans,
        'read_plans topic': partial(lip.read_plans, 'run.mcap'),
        'fit': lip.fit,
        'fit settings': partial(lip.fit, data),
        'evaluate model': lambda value: lip.evaluate(value, data),
        'evaluate dataset': lambda value: lip.evaluate(small_model(), value),
        'fit_cautions': lip.fit_cautions,
        'Dataset.load': lip.Dataset.load,
        'Dataset.save': data.save,
        'Dataset.select': data.select,
        'Dataset.split': data.split,
        'Dataset.with_joints': data.with_joints,
        'model.load': lip.InverseDynamicsModel.load,
        'model.save': lambda value: small_model().save(value),
        'Config fit': lambda value: lip.Config(fit=value),
        'FitSettings kernel': lambda value: lip.FitSettings(kernel=value),
        'FitSettings seed': lambda value: lip.FitSettings(seed=value),
        'RecordingSettings joints': lambda value: lip.RecordingSettings(joints=value),
    }
    given = {name: getattr(data, name) for name in ARRAYS}
    for name in (*ARRAYS, 'joint_names', 'joint_types', 't'):
        found[f'from_arrays {name}'] = partial(with_one, lip.Dataset.from_arrays, given, name)
    fields = {**vars(data)}
    for name in ('segment', 'kinetic', 'provenance', 'gravity_compensated'):
        found[f'Dataset {name}'] = partial(with_one, lip.Dataset, fields, name)
    functions = {
        'predict': STATES,
        'standard_deviation': STATES,
        'inertia_matrix': ('q',),
        'coriolis': STATES[:2],
        'gravity': ('q',),
        'friction': STATES[:2],
        'kinetic_energy': STATES[:2],
        'potential_energy': ('q',),
    }
    for function, names in functions.items():
        states = dict.fromkeys(names, some)
        for name in names:
            method = partial(of_model, function)
            found[f'model.{function} {name}'] = partial(with_one, method, states, name)
    return found


def of_model(name: str, **values: Any) -> object:
    return getattr(small_model(), name)(**values)


def with_one(function: Callable[..., object], given: Any, name: str, value: Any) -> object:
    return function(**{**given, name: value})


CALLS = calls()
USABLE = {
    *product(('fit settings', 'from_arrays t', 'Dataset kinetic'), ['none']),
    *product(('from_arrays joint_names', 'from_arrays joint_types'), ['none']),
    ('model.friction q', 'none'),
    *product(('Dataset.save', 'model.save'), ['text']),
    ('Dataset provenance', 'mapping'),
}
REFUSED = [each for each in product(CALLS, STRANGE) if each not in USABLE]


@pytest.mark.parametrize(('call', 'value'), REFUSED, ids='-'.join)
def test_what_cannot_be_used_is_refused_with_a_sentence(
    call: str, value: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises((lip.LipIdError, FileNotFoundError)) as refused:
        CALLS[call](STRANGE[value])
    sentence = str(refused.value)
    assert sentence
    assert '\n' not in sentence
    assert list(tmp_path.iterdir()) == []


def test_every_public_function_is_tried() -> None:
    classes = {'Config', 'Dataset', 'FitSettings', 'RecordingSettings'}
    tried = {name.partition(' ')[0].partition('.')[0] for name in CALLS}
    functions = {name for name in lip.__all__ if name[0].islower()}
    assert tried == functions | classes | {'from_arrays', 'model'}
