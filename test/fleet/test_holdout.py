"""What is held out of a fit to several recordings is judged, and nothing is learned from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from fleet.fleets import arm_of, FileSource, friction_of, PlainEngine, recording, save
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import data_remarks, evaluate
from lip_id_ros.fleet.fit import fit_fleet
from lip_id_ros.fleet.passes import Passes
from lip_id_ros.fleet.recordings import selected
from lip_id_ros.fleet.results import FITTED, HELD_OUT
from lip_id_ros.fleet.survey import first_shares
from lip_id_ros.loading import load_dataset
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import silent
from lip_id_ros.settings import AUTO, Config, PreprocessingSettings

ARM = arm_of()


@given(st.lists(st.integers(1, 1000), min_size=1, max_size=6), st.floats(0.05, 0.95))
def test_shares_are_those_of_the_joined_samples(counts: list[int], share: float) -> None:
    total = sum(counts)
    expected = round(share * total)
    by_number = dict(enumerate(counts))
    if not 0 < expected < total:
        with pytest.raises(DataError, match='leaves nothing to learn from, or to hold out'):
            first_shares(by_number, share)
        return
    shares = first_shares(by_number, share)
    assert sum(round(shares[k] * counts[k]) for k in shares) == expected
    values = [shares[k] for k in sorted(shares)]
    assert values == sorted(values, reverse=True)
    assert sum(0.0 < value < 1.0 for value in values) <= 1


def parameters(model: InverseDynamicsModel) -> tuple[object, ...]:
    arm = model.arm
    assert arm is not None
    return arm.links, arm.chain.translations, arm.friction.coefficients, arm.covariance_root


@pytest.mark.slow
def test_a_fit_with_holdout_is_one_to_the_rest(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    data = [recording(ARM, friction_of(ARM, rng, 0.05), k) for k in range(4)]
    sources = [save(each, tmp_path / f'{k}.npz', '') for k, each in enumerate(data)]
    first, last = data[2].split(0.4)
    part = save(first, tmp_path / 'part.npz', '')
    plain = fit_fleet([*sources[:2], part], Config(), PlainEngine())
    held_out = fit_fleet(sources, Config(), PlainEngine(), holdout=0.4)
    for found, other in zip(parameters(held_out.model), parameters(plain.model), strict=True):
        assert_array_equal(found, other)
    assert [each.status for each in held_out.recordings] == [FITTED] * 3 + [HELD_OUT]
    assert held_out.evaluation is not None
    whole = evaluate(plain.model, concatenate([last, data[3]]))
    assert held_out.evaluation.n_samples == whole.n_samples
    assert_allclose(held_out.evaluation.nmse_percent, whole.nmse_percent, rtol=1e-9)
    assert plain.evaluation is None
    judged = held_out.model.summary['held_out']
    assert_allclose(judged['nmse_percent'], whole.nmse_percent, rtol=1e-9)
    assert 0.0 < judged['new_motion_s'] < 16.0


def log(path: Path, data: Dataset) -> FileSource:
    columns = {'t': data.t}
    for name, signal in (('q', data.q), ('tau', data.tau)):
        columns |= {f'{name}_{k}': column for k, column in enumerate(signal.T)}
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=',', header=','.join(columns), comments='')
    return FileSource(str(path), '')


@pytest.mark.slow
def test_preprocessing_is_selected_once_on_what_is_learned_from_alone(tmp_path: Path) -> None:
    rng, cache = np.random.default_rng(1), dict[str, bytes]()
    one, other = (recording(ARM, friction_of(ARM, rng, 0.05), k, 1500) for k in range(2))
    tau = np.array(other.tau)
    tau[900:] += rng.standard_normal(tau[900:].shape)
    config = Config(preprocessing=PreprocessingSettings(cutoff_hz=AUTO))
    found = []
    for name, each in (('sound', other), ('spoilt', replace(other, tau=tau))):
        sources = [log(tmp_path / '1.csv', one), log(tmp_path / f'2_{name}.csv', each)]
        found.append(fit_fleet(sources, config, PlainEngine(), cache, holdout=0.4))
    sound, spoilt = found
    for first, second in zip(parameters(sound.model), parameters(spoilt.model), strict=True):
        assert_array_equal(first, second)
    assert spoilt.evaluation is not None
    assert sound.evaluation is not None
    assert spoilt.evaluation.rmse > sound.evaluation.rmse
    chosen = sound.model.provenance['sources'][0]
    assert chosen['preprocessing']['cutoff_hz'] == chosen['elected']['cutoff_hz']
    remarks = data_remarks(sound.model.provenance)
    assert any('selected by cross-validation: cut-off' in text for text in remarks)


@pytest.mark.slow
def test_preprocessing_is_that_of_the_recording_alone_and_is_kept(tmp_path: Path) -> None:
    data = recording(ARM, friction_of(ARM, np.random.default_rng(1), 0.0), 1, 1500)
    source = log(tmp_path / 'log.csv', data)
    config = Config(preprocessing=PreprocessingSettings(cutoff_hz=AUTO))
    alone = load_dataset(source.name, config).provenance['sources'][0]
    passes = Passes(PlainEngine(), dict[str, bytes](), silent)
    found, entries = selected([(source, 1.0)], data.joint_names, config, passes)
    assert entries == {'elected': alone['elected']}
    assert found.preprocessing.cutoff_hz == alone['preprocessing']['cutoff_hz']
    assert found.recording.effort_delay_s == tuple(alone['recording']['effort_delay_s'])
    assert found.fit == config.fit
    known = Known(source.name, source.group, source.fingerprint)
    Path(source.name).unlink()
    assert selected([(known, 1.0)], data.joint_names, config, passes) == (found, entries)


@dataclass(frozen=True)
class Known(FileSource):
    """A recording whose fingerprint is known, but that is gone."""

    fingerprint: str = ''
