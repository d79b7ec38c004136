"""What was recorded live and what lies in bags make one data set."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lip_id_ros.acquisition.job_process import training_set
from lip_id_ros.acquisition.recorder import keep
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import data_remarks
from lip_id_ros.progress import silent
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.bag_writer import JointStateTrack
from lip_id_ros.settings import Config, PreprocessingSettings, RecordingSettings

RECORDING = RecordingSettings(
    effort_scale=(2.0, -1.0), effort_offset=(0.5, 0.0), gravity_compensated=True
)
CONFIG = Config(recording=RECORDING)


def samples(n_samples: int, start_s: int = 1000) -> JointSamples:
    t = 0.01 * np.arange(n_samples, dtype=np.float64)
    q = np.sin(np.outer(t, [1.0, 2.0]))
    return JointSamples(t, q, np.cos(q), 3.0 * q, ('a', 'b'), start_s * 10**9)


def kept(path: Path, samples: JointSamples) -> Path:
    signals = samples.position, samples.velocity, samples.effort
    known = '/states', samples.joint_names, samples.t, *signals, samples.start_ns
    return keep(path, JointStateTrack(*known))


def test_live_recording_and_bags_are_joined_by_name(tmp_path: Path) -> None:
    live = samples(500)
    arrays = (live.position, live.velocity, live.effort)
    position, velocity, effort = (each[:, ::-1] for each in arrays)
    turned = JointSamples(live.t, position, velocity, effort, ('b', 'a'), 2000 * 10**9)
    bag = kept(tmp_path / 'b.mcap', turned)
    alone = training_set([live], [], CONFIG, silent).dataset
    both = training_set([live], [str(bag)], CONFIG, silent).dataset
    assert both.joint_names == ('a', 'b')
    assert both.n_samples == 2 * alone.n_samples
    np.testing.assert_allclose(both.q[alone.n_samples :], alone.q, atol=1e-9)
    np.testing.assert_allclose(both.tau[alone.n_samples :], alone.tau, atol=1e-9)
    assert len(set(both.segment)) == 2
    assert [source['source'] for source in both.provenance['sources']] == [
        'the recording',
        str(bag),
    ]


def test_a_bag_alone_is_enough(tmp_path: Path) -> None:
    bag = kept(tmp_path / 'b.mcap', samples(500))
    assert training_set([], [str(bag)], CONFIG, silent).dataset.n_samples > 50


def test_what_effort_means_is_applied_and_noted() -> None:
    data = training_set([samples(500)], [], CONFIG, silent).dataset
    np.testing.assert_allclose(data.tau, [0.5, 0.0] + [2.0, -1.0] * (3.0 * data.q), atol=1e-3)
    assert data.gravity_compensated
    noted = data.provenance['sources'][0]['recording']
    assert noted['effort_scale'] == (2.0, -1.0)
    assert noted['effort_offset'] == (0.5, 0.0)
    assert noted['gravity_compensated'] is True


def test_sections_that_are_too_short_are_left_out_and_listed() -> None:
    sections = [samples(1), samples(500), samples(20), samples(20)]
    made = training_set(sections, [], CONFIG, silent)
    assert (
        made.dataset.n_samples
        == training_set([samples(500)], [], CONFIG, silent).dataset.n_samples
    )
    first, others = made.left_out
    assert first.startswith('the recording must hold at least t')
    # a clock that went back a hundred times gave a hundred sentences
    assert others.startswith('2 parts of the recording: the recording must hold a motion o')


def test_what_is_used_is_shown_raw_and_judged(tmp_path: Path) -> None:
    stuck = samples(500)
    stuck.effort[:, 1] = 0.0
    bag = kept(tmp_path / 'b.mcap', samples(500, 2000))
    data = training_set([samples(1), stuck], [str(bag)], CONFIG, silent).dataset
    (constant,) = (text for text in data_remarks(data.provenance) if 'effort_constant' in text)
    assert constant.startswith('error effort_constant: the effort of b')
    assert constant.endswith(' In the recording.')


def test_what_a_bag_repeats_of_the_live_recording_is_noted(tmp_path: Path) -> None:
    bags = [str(kept(tmp_path / name, samples(500, 2000))) for name in ('a.mcap', 'b.mcap')]
    data = training_set([samples(500)], bags, CONFIG, silent).dataset
    (copy,) = (text for text in data_remarks(data.provenance) if 'repeat an earlier' in text)
    assert (
        copy == f'500 of 500 samples of {bags[1]} repeat an earlier recording and were left out.'
    )


def test_nothing_but_sections_that_are_too_short_is_refused() -> None:
    with pytest.raises(DataError, match=r'^the recording must hold at least two different'):
        training_set([samples(1), samples(20)], [], CONFIG, silent)


def test_the_bound_holds_for_all_sources_together(tmp_path: Path) -> None:
    bag = kept(tmp_path / 'b.mcap', samples(500, 2000))
    config = Config(recording=RECORDING, preprocessing=PreprocessingSettings(max_samples=40))
    data = training_set([samples(500)], [str(bag)], config, silent).dataset
    assert data.n_samples == 40
    assert len(set(data.segment)) == 2


def test_the_bound_thins_bags_and_live_samples_alike(tmp_path: Path) -> None:
    bag = kept(tmp_path / 'b.mcap', samples(1000, 5000))
    bounded = Config(recording=RECORDING, preprocessing=PreprocessingSettings(max_samples=40))
    everything = training_set([samples(1000)], [str(bag)], CONFIG, silent)
    thinned = training_set([samples(1000)], [str(bag)], bounded, silent)
    assert everything.n_thinned == 0
    assert thinned.n_thinned == everything.dataset.n_samples - thinned.dataset.n_samples
    of_bag = np.count_nonzero(thinned.dataset.segment == thinned.dataset.segment.max())
    assert of_bag == pytest.approx(thinned.dataset.n_samples / 2, abs=2)
