"""Joint states of an arm that changes become updates; bad ones are refused or gated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
import re
from typing import Any

from adaptation import arms
from adaptation.arms import message_of, with_friction
import numpy as np
import pytest

from lip_id_ros.adaptation.adapted_model import AdaptedModel
from lip_id_ros.adaptation.follow_settings import FollowRules
from lip_id_ros.adaptation.followed import FollowedArm, WalkSettings
from lip_id_ros.adaptation.live import AdaptSettings, LiveAdaptation, Step
from lip_id_ros.errors import DataError
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.model import EffortCalibration, InverseDynamicsModel
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joints import Refusal, RefusedError
from lip_id_ros.signals.status import Level

RATE_HZ, START_NS = 50.0, 1_000_000_000_000
CENTRE, INERTIA = np.array([0.0, 0.0, 0.1]), np.array([0.003, 0.0, 0.0, 0.004, 0.0, 0.005])
OUTCOMES = ('learned', 'held', 'disturbed', 'resting', 'settling')
GATES = ('too_soon', 'after_a_gap', 'out_of_range', 'waiting')


def states(
    model: InverseDynamicsModel,
    seconds: float,
    start: float = 0.0,
    rest: bool = False,
    middle: float = 0.0,
) -> Iterator[JointMessage]:
    """Yield joint states of slow sinusoids with the torques of an arm."""
    rng = np.random.default_rng(2)
    t = start + np.arange(0.0, seconds, 1.0 / RATE_HZ)
    w = 2.0 * np.pi * np.array([[0.11, 0.17, 0.23], [0.05, 0.07, 0.13]])[:, None]
    phase = w * t[:, None] + np.array([0.0, 1.0, 2.0])
    a = np.zeros((2, 1, 3)) if rest else np.array([0.6, 0.5])[:, None, None]
    parts = a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase)
    q, dq, ddq = (each.sum(axis=0) for each in parts)
    q += middle
    tau = model.predict(q, dq, ddq).tau + 0.02 * rng.standard_normal(q.shape)
    for row, time in enumerate(t):
        stamp = START_NS + round(1e9 * time)
        yield JointMessage(stamp, model.joint_names, q[row], dq[row], tau[row])


def within_a_turn(messages: Iterator[JointMessage]) -> Iterator[JointMessage]:
    """Report positions from minus half a turn to half a turn."""
    for each in messages:
        q = np.asarray(each.position)
        turns = np.round(q / (2.0 * np.pi))
        yield each._replace(position=(q - 2.0 * np.pi * turns).tolist())


def known_model() -> InverseDynamicsModel:
    """Return a model of efforts that are torques."""
    return replace(arms.known_model(), effort_calibrations=(EffortCalibration.identity(3),))


@pytest.fixture
def path(tmp_path: Path) -> str:
    known_model().save(tmp_path / 'model.npz')
    return str(tmp_path / 'model.npz')


def live(path: str, node: str = '/adapt', **settings: Any) -> LiveAdaptation:
    own: dict[str, Any] = {'state_path': path.replace('model', 'state'), **settings}
    return LiveAdaptation(AdaptSettings(model_path=path, **own), node, 0.0, 1000.0)


def feed(found: LiveAdaptation, messages: Iterator[JointMessage], now: float = 1.0) -> Step:
    for message in messages:
        found.take(message)
    return found.step(now, 1000.0 + now)


def test_friction_that_falls_comes_out_as_an_update_that_is_followed(path: str) -> None:
    model = InverseDynamicsModel.load(path)
    warm = with_friction(model, 0.5)
    found = live(path)
    step = feed(found, states(warm, 40.0))
    assert step.update is not None
    assert step.update.trusted
    adapted = AdaptedModel(model, FollowRules(0.0, 5.0, np.full(3, 5.0)))
    adapted.take(message_of(step.update), 0.0, 0)
    state = np.array([[0.3, -0.4, 0.5], [0.6, -0.5, 0.4], [0.0, 0.0, 0.0]])
    errors = [np.abs(each.query(*state).tau - warm.query(*state).tau).max() for each in (
        adapted.newest, model
    )]  # fmt: skip
    assert errors[0] < 0.15 * errors[1]
    values = found.values()
    assert values['changes']
    assert values['received'] == sum(values[key] for key in (*OUTCOMES, *GATES))
    assert found.status(1.0).level is Level.WARN
    assert {text.partition(':')[0] for text in step.alarms} <= {*model.joint_names}
    assert step.alarms
    assert not found.step(1.1, 1001.1).alarms  # said once


def test_positions_that_are_reported_within_a_turn_teach_the_same(path: str) -> None:
    """A low-pass across the jump would give positions between, at which the arm was not."""
    model = known_model()
    low, high = 4.0 * np.stack(model.training_range)
    replace(model, training_range=(low, high)).save(path)
    numbers = []
    for change in (iter, within_a_turn):
        found = live(path, state_path='none')
        messages = list(states(with_friction(model, 0.5), 40.0, middle=np.pi))
        step = feed(found, change(iter(messages)))
        assert found.values()['out_of_range'] == 0
        assert step.update is not None
        numbers.append(step.update.numbers)
    assert any(np.ptp(each.position) > 6.0 for each in within_a_turn(iter(messages)))
    np.testing.assert_allclose(numbers[1], numbers[0], rtol=1e-6, atol=1e-9)


def test_an_alarm_that_comes_back_is_told_again(path: str) -> None:
    found = live(path)
    first = feed(found, states(with_friction(known_model(), 0.5), 40.0)).alarms
    assert first
    found.settings = replace(found.settings, alarm_change=1e3)
    assert not found.step(1.1, 1001.1).alarms
    found.settings = replace(found.settings, alarm_change=0.5)
    assert found.step(1.2, 1001.2).alarms == first


def test_updates_stop_with_the_joint_states(path: str) -> None:
    found = live(path)
    assert found.step(0.0, 1000.0).update is None
    assert found.status(0.0).level is Level.WARN
    assert feed(found, states(known_model(), 3.0)).update is not None
    assert found.step(2.0, 1002.0).update is not None
    assert found.values()['updates'] == 2
    assert found.status(2.0).level is Level.OK
    assert found.step(4.0, 1004.0).update is None
    assert found.status(4.0).summary == 'no joint states: no updates'


def test_what_was_learned_is_there_after_a_restart(path: str) -> None:
    warm = with_friction(known_model(), 0.5)
    first = live(path)
    step = feed(first, states(warm, 40.0))
    first.save(1001.0)
    second = live(path)
    assert second.values()['note'] == ''
    again = feed(second, states(warm, 20.0, start=100.0))
    assert step.update is not None
    assert again.update is not None
    assert again.update.trusted
    np.testing.assert_allclose(again.update.numbers, step.update.numbers, atol=0.05)


@pytest.mark.parametrize('kind', ['foreign', 'broken'])
def test_a_state_that_cannot_be_used_is_kept_aside(path: str, kind: str) -> None:
    state = Path(path.replace('model', 'state'))
    if kind == 'broken':
        state.write_bytes(b'no archive')
    else:
        with_friction(known_model(), 0.9).save(path)
        live(path).save(1000.0)
        known_model().save(path)
    before = state.read_bytes()
    found = live(path)
    assert 'it is kept as' in found.values()['note']
    assert state.with_name('state.npz.old').read_bytes() == before
    assert not state.exists()
    feed(found, states(known_model(), 3.0))
    assert found.status(1.0).level is Level.WARN


@pytest.mark.parametrize(
    ('key', 'value'),
    [
        *(('saved_at', x) for x in (np.nan, np.inf, -np.inf)),
        *(('payload', np.ones(k)) for k in (1, 3)),
        ('covariance', -np.eye(42)),
        ('covariance', np.triu(np.ones((42, 42)))),
        ('inflations', np.zeros(3)),
    ],
)
def test_a_state_with_a_part_that_is_none_is_kept_aside(path: str, key: str, value: Any) -> None:
    state = path.replace('model', 'state')
    live(path).save(1000.0)
    arrays, header = read_npz(state)
    of_file = arrays if key in arrays else header
    of_file[key] = value
    write_npz(state, arrays, header)
    found = live(path)
    assert 'it is kept as' in found.values()['note']
    feed(found, states(known_model(), 3.0))
    assert np.isfinite(found.values()['error_adapted'])


def test_a_disk_that_fails_is_in_the_status(path: str, tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    found = live(path, state_path=str(tmp_path / 'file' / 'state.npz'))
    feed(found, states(known_model(), 3.0))
    found.save(1000.0)
    assert 'cannot be written' in found.status(1.0).summary


@pytest.mark.parametrize('name', ['XDG_STATE_HOME', 'HOME'])
def test_the_state_of_a_node_lies_under_its_full_name(
    path: str, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv('XDG_STATE_HOME', raising=False)
    monkeypatch.setenv(name, str(tmp_path))
    live(path, node='/left/adapt', state_path='').save(1000.0)
    folder = tmp_path / ('.local/state' if name == 'HOME' else '')
    assert (folder / 'ros/lip_id_ros/left/adapt/adaptation.npz').exists()
    assert live(path, node='/left/adapt', state_path='').note == ''


def test_the_state_of_another_node_is_neither_followed_nor_touched(path: str) -> None:
    first = live(path, node='/left/adapt')
    first.announce(1.5, CENTRE, np.zeros(6), '')
    first.step(0.0, 1000.0)
    state = Path(path.replace('model', 'state'))
    before = state.read_bytes()
    found = live(path, node='/right/adapt')
    assert found.values()['announced_kg'] == 0.0
    assert found.note == (
        f'state_path must be a file of /right/adapt alone, but {state} is of /left/adapt, whose '
        'payloads are not carried here; nothing is kept until another one is given.'
    )
    feed(found, states(known_model(), 3.0))
    assert found.status(1.0).summary == found.note
    found.save(1001.0)
    assert state.read_bytes() == before


def test_an_announced_payload_is_in_the_update_at_once_and_a_reset_takes_it_off(
    path: str,
) -> None:
    found = live(path)
    found.announce(0.5, CENTRE, INERTIA, 'joint_3_link')
    step = found.step(1.5, 1001.5)
    assert step.update is not None  # though no joint state has come
    links = known_model().arm.links  # type: ignore[union-attr]
    numbers = step.update.numbers[: links.size].reshape(links.shape)
    change = FollowedArm(known_model(), WalkSettings()).export_frame @ (numbers - links)[-1, :10]
    np.testing.assert_allclose(change[:4], [0.5, 0.0, 0.0, 0.05], atol=1e-9)
    np.testing.assert_allclose(change[[4, 7, 9]], [0.008, 0.009, 0.005], atol=1e-9)
    assert not step.update.trusted
    mass, centre, inertia = step.carried
    assert mass == pytest.approx(0.5)
    np.testing.assert_allclose(centre, CENTRE, atol=1e-9)
    np.testing.assert_allclose(inertia, INERTIA, atol=1e-9)
    assert found.values()['announced_kg'] == pytest.approx(0.5)
    assert found.values()['payload'].startswith('0.5 ± 0 kg')
    again = live(path)
    assert again.values()['announced_kg'] == pytest.approx(0.5)
    carried = again.step(0.0, 1000.0).payloads[0].payload
    assert carried is not None
    assert carried.mass == pytest.approx(0.5)
    found.reset()
    step = found.step(1.6, 1001.6)
    assert step.update is not None
    assert [each.payload for each in step.payloads] == [None]
    np.testing.assert_array_equal(step.update.numbers[: links.size], links.ravel())
    assert live(path).values()['announced_kg'] == 0.0


def test_a_payload_that_is_put_down_while_the_arm_is_silent_is_published(path: str) -> None:
    found = live(path)
    found.announce(0.5, CENTRE, np.zeros(6), '')
    assert found.step(0.0, 1000.0).update is not None
    assert found.step(60.0, 1060.0).update is None
    found.announce(0.0, np.full(3, np.nan), np.zeros(6), '')
    step = found.step(61.0, 1061.0)
    assert step.update is not None
    links = known_model().arm.links  # type: ignore[union-attr]
    np.testing.assert_array_equal(step.update.numbers[: links.size], links.ravel())
    assert step.carried[0] == 0.0


@pytest.mark.parametrize(
    ('mass', 'centre', 'inertia', 'frame', 'sentence'),
    [
        (400.0, [0.0, 0.0, 120.0], 0.0, '', 'within 10 m of the last link, but has 400 kg at'),
        (4000.0, [0.0, 0.0, 0.1], 0.0, '', 'a mass of up to 1000 kg'),
        (-0.5, [0.0, 0.0, 0.1], 0.0, '', 'but has -0.5 kg'),
        (np.nan, [0.0, 0.0, 0.1], 0.0, '', 'but has nan kg'),
        (0.5, [0.0, np.inf, 0.1], 0.0, '', 'at (0, inf, 0.1) m'),
        (0.5, [0.0, 0.0, 0.1], -0.1, '', 'an inertia about its centre of mass'),
        (0.5, [0.0, 0.0, 0.1], np.nan, '', 'an inertia about its centre of mass'),
        (0.5, [0.0, 0.0, 0.1], 0.0, 'tool0', 'joint_3_link, the frame of the last link'),
    ],
)
def test_what_is_no_payload_is_refused(
    path: str, mass: float, centre: list[float], inertia: float, frame: str, sentence: str
) -> None:
    found = live(path)
    with pytest.raises(DataError, match=re.escape(sentence)):
        found.announce(mass, np.array(centre), inertia * np.array([1, 0, 0, 1, 0, 1]), frame)
    feed(found, states(known_model(), 3.0))
    assert found.values()['announced_kg'] == 0.0
    assert sentence in found.status(1.0).summary
    found.announce(0.0, CENTRE, INERTIA, '')
    assert sentence not in found.status(1.0).summary


def test_a_payload_of_any_size_that_can_be_announced_leaves_numbers(path: str) -> None:
    found = live(path)
    found.announce(1000.0, np.array([-10.0, 0.0, 10.0]), np.zeros(6), '')
    step = feed(found, states(known_model(), 3.0))
    assert step.update is not None
    assert np.isfinite(step.update.numbers).all()


def test_a_clock_that_was_set_back_is_followed(path: str) -> None:
    found = live(path)
    feed(found, states(known_model(), 5.0, start=100.0))
    learned = found.values()['learned']
    for message in states(known_model(), 5.0):
        with suppress(RefusedError):  # of the first two stamps
            found.take(message)
    assert found.values()['refused'] == {Refusal.BACKWARD_STAMP.value: 2}
    found.step(1.0, 1001.0)
    assert found.values()['learned'] > learned + 50


def test_a_pause_of_the_joint_states_is_time_in_which_friction_may_change(path: str) -> None:
    friction, open_ = [], []
    for began_at in (1.0, 3600.0):
        found = live(path)
        feed(found, states(with_friction(known_model(), 0.5), 40.0))
        for message in states(known_model(), 0.3, start=3640.0):
            with suppress(RefusedError):  # of the first two stamps
                found.take(message)
        found.step(began_at, 1000.0)
        adaptation = found._adaptation
        friction.append(adaptation.numbers[adaptation.arm.friction])
        open_.append(np.sqrt(np.diagonal(adaptation.covariance)[-9:]))
    assert (open_[1] > 3.0 * open_[0]).all()
    fit = known_model().arm.friction.coefficients  # type: ignore[union-attr]
    assert np.linalg.norm(friction[1] - fit) < 0.9 * np.linalg.norm(friction[0] - fit)


def test_joint_states_that_come_too_far_apart_are_in_the_status(path: str) -> None:
    found = live(path)
    few = list(states(known_model(), 20.0))[::20]
    feed(found, iter(few[:25]))
    assert 'over 0.2 s apart' in found.status(1.0).summary
    feed(found, iter(few[25:]))
    assert 'over 0.2 s apart' in found.status(1.0).summary
    feed(found, states(known_model(), 3.0, start=20.0))
    assert found.status(1.0).summary == 'as commissioned'


def test_an_arm_at_rest_and_one_out_of_its_range_are_counted_as_such(path: str) -> None:
    """It was trained within 1.5 rad, and may go a fifth of that beyond."""
    found = live(path)
    feed(found, standing_at(1.79))
    assert found.values()['resting'] > 50
    assert found.values()['out_of_range'] == 0
    feed(found, standing_at(1.81, start=6.0))
    assert found.values()['out_of_range'] > 50
    assert found.values()['learned'] == 0


def test_a_joint_that_has_just_turned_teaches_nothing(path: str) -> None:
    found = live(path, cutoff_hz=1.0)
    for number, message in enumerate(states(known_model(), 5.0, rest=True)):
        found.take(message._replace(velocity=[-0.5 if number % 2 else 1.5] * 3))
    found.step(1.0, 1001.0)
    values = found.values()
    assert values['resting'] > 20
    assert values['learned'] == values['disturbed'] == 0


def standing_at(q: float, start: float = 0.0) -> Iterator[JointMessage]:
    """Yield joint states of an arm whose joints stand at a position [rad]."""
    for message in states(known_model(), 5.0, start, rest=True):
        yield message._replace(position=[q] * 3)


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        ({'effort': []}, Refusal.NO_EFFORT),
        ({'effort': [0.0, 1e9, 0.0]}, Refusal.TOO_LARGE),
        ({'velocity': [0.0, np.nan, 0.0]}, Refusal.NOT_FINITE),
        ({'names': ['a', 'b', 'c']}, Refusal.FOREIGN_JOINTS),
        ({'stamp_ns': 0}, Refusal.NO_STAMP),
    ],
)
def test_a_joint_state_that_cannot_be_used_is_refused(
    path: str, change: dict[str, Any], reason: Refusal
) -> None:
    found = live(path)
    message = next(states(known_model(), 1.0))._replace(**change)
    with pytest.raises(RefusedError) as refused:
        found.take(message)
    assert refused.value.reason is reason
    assert found.values()['refused'] == {reason.value: 1}
