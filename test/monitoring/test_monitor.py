"""Estimates of the monitor from joint states, and its refusals."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from pathlib import Path
from typing import Any

from adaptation.arms import known_model, message_of, stream
from nodes import toy
import numpy as np
import pytest

from lip_id_ros.adaptation.updates import Update
from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError, DataError, ModelError
from lip_id_ros.model import DynamicsModel, InverseDynamicsModel, Prediction
from lip_id_ros.monitoring.monitor import Monitor, Watched
from lip_id_ros.monitoring.settings import MonitorSettings
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joints import RefusedError
from lip_id_ros.signals.status import Level

START_NS = 1_700_000_000_000_000_000
T, Q, DQ, DDQ = toy.motion(1500, seed=3)
TAU = toy.torque(Q, DDQ)
CONTACT = np.array([0.0, 2.0])


@pytest.fixture(scope='module')
def path(tmp_path_factory: pytest.TempPathFactory) -> str:
    return toy.model_path(tmp_path_factory)


def monitor(path: str, **values: object) -> Monitor:
    settings = {'smallest_contact': (2.0,), 'calibration_s': 5.0, **values}
    return Monitor(MonitorSettings(model_path=path, **settings))  # type: ignore[arg-type]


def message(row: int, contact: float = 0.0, shift_s: float = 0.0) -> JointMessage:
    """Return a sample of the motion, joints in the other order; a contact does a part."""
    stamp = START_NS + round(1e9 * (T[row] + shift_s))
    q, dq, tau = (values[row, ::-1].tolist() for values in (Q, DQ, TAU - contact * CONTACT))
    return JointMessage(stamp, toy.JOINTS[::-1], q, dq, tau)


def touches(watched: Watched) -> bool:
    assert watched.contacts is not None
    return bool(watched.contacts['contact'].any())


def is_beyond(watched: Watched) -> bool:
    """Whether a torque is beyond its threshold at a joint that sees."""
    found = watched.contacts
    assert found is not None
    beyond = np.abs(found['torque']) > found['threshold']
    return bool((beyond > found['blind']).any())


def take(watching: Monitor, rows: range, contact: float = 0.0) -> list[Watched]:
    found = [watching.take(message(row, contact)) for row in rows]
    return [each for each in found if each is not None]


@pytest.mark.slow
def test_a_contact_is_detected_in_time_after_calibration(path: str) -> None:
    watching = monitor(path)
    assert all(each.contacts is None for each in take(watching, range(200)))
    assert watching.values()['state'] == 'not calibrated'
    assert watching.contacts.calibrate() == (
        'watching 5 s of motion; move all joints as in use, without any contact'
    )
    take(watching, range(200, 701))
    assert watching.values()['state'] == 'watching'
    assert all(0.0 < each < 0.5 for each in watching.values()['deviation_constant'])

    assert not any(touches(each) for each in take(watching, range(701, 1200)))
    pushed = take(watching, range(1200, 1230), contact=1.0)
    flagged = [touches(each) for each in pushed]
    assert flagged.index(True) < 10  # 100 ms
    assert flagged == sorted(flagged)  # held
    np.testing.assert_allclose(pushed[-1].external.torque, CONTACT, atol=0.3)
    assert watching.values()['contacts'] == 1
    # let go of: a step too, then flagged no more
    assert not touches(take(watching, range(1230, 1400))[-1])


@pytest.mark.slow
def test_deviations_can_be_given_and_are_what_the_status_has(path: str) -> None:
    given = {'deviation_constant': (0.15, 0.2), 'deviation_torque': (0.0,)}
    watching = monitor(path, **given, joints=toy.JOINTS[::-1])
    values = watching.values()
    assert values['deviation_constant'] == [0.2, 0.15]
    assert values['deviation_torque'] == values['deviation_inertial'] == [0.0, 0.0]
    assert values['deviation_rest'] == [0.5, 0.5]
    assert not any(touches(each) for each in take(watching, range(300)))
    assert any(touches(each) for each in take(watching, range(300, 310), contact=1.0))


@pytest.mark.parametrize('hold_s', [0.0, 0.2, 0.7])
def test_what_touches_is_a_contact_however_long_it_is_held(path: str, hold_s: float) -> None:
    watching = monitor(path, hold_s=hold_s, deviation_constant=(0.2,), deviation_torque=(0.0,))
    take(watching, range(300))
    pushed = take(watching, range(300, 330), contact=1.0)
    touching = [touches(each) for each in pushed if is_beyond(each)]
    assert touching
    assert all(touching)


def test_energy_and_its_balance(path: str) -> None:
    watching = monitor(path)
    free = take(watching, range(400))
    kinetic = np.array([toy.kinetic(dq) for dq in DQ[1:400]])
    potential = -toy.WEIGHT @ np.cos(Q[1:400]).T
    total = np.array([each.energy.total for each in free])
    np.testing.assert_allclose(total - total[0], (kinetic + potential) - (kinetic + potential)[0],
                               atol=0.1)  # fmt: skip
    assert np.abs([each.energy.unexplained for each in free]).max() < 0.5
    pushed = take(watching, range(400, 450), contact=1.0)
    expected = DQ[449] @ CONTACT
    assert pushed[-1].energy.unexplained == pytest.approx(expected, abs=0.5)


def test_what_comes_too_often_is_left_aside(path: str) -> None:
    watching = monitor(path, rate_hz=10.0)
    assert len(take(watching, range(501))) == 50


@pytest.mark.parametrize(('shift_s', 'n_doubted'), [(-3600.0, 2), (5.0, 0), (20.0, 2)])
def test_a_gap_and_a_clock_set_back_begin_anew(path: str, shift_s: float, n_doubted: int) -> None:
    watching = monitor(path, deviation_constant=(0.2,))
    take(watching, range(100))
    assert touches(take(watching, range(100, 120), contact=1.0)[-1])
    for row in range(120, 120 + n_doubted):
        with pytest.raises(RefusedError):
            watching.take(message(row, 0.0, shift_s))
    after = [watching.take(message(row, 0.0, shift_s)) for row in range(120 + n_doubted, 200)]
    assert after[0] is None
    known = [each for each in after[1:] if each is not None]
    assert len(known) == 79 - n_doubted
    assert not any(touches(each) for each in known)
    assert np.abs([each.external.torque for each in known]).max() < 0.3


def test_nothing_is_judged_before_the_observer_has_settled(path: str) -> None:
    watching = monitor(path, deviation_constant=(0.2,), deviation_torque=(0.0,))
    take(watching, range(100))
    began = take(watching, range(130, 150), contact=1.0)
    blind = [bool(each.contacts['blind'].all()) for each in began if each.contacts is not None]
    assert blind == sorted(blind, reverse=True)
    assert blind.count(True) == 16  # 8 / 50 s
    assert not any(touches(each) for each in began[:16])
    assert touches(began[-1])
    assert watching.values()['blind'] > 16  # those at the start too


class Sprung:
    """A model with a spring of 2 N m/rad at each joint."""

    def __init__(self, model: DynamicsModel) -> None:
        self._model, self.training_range = model, model.training_range

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        found = self._model.predict(q, dq, ddq)
        return replace(found, tau=found.tau + 2.0 * q)


def sprung(path: str) -> Monitor:
    watching = monitor(path)
    watching._predictor = Sprung(watching._predictor)  # type: ignore[arg-type]
    watching._begin_anew()
    return watching


def test_a_position_that_wraps_by_a_turn_changes_no_estimate(path: str) -> None:
    """A spring's torque, unlike gravity's, is another one after a turn."""
    plain, wrapped = sprung(path), sprung(path)
    expected = take(plain, range(300))
    found = []
    for row in range(300):
        each = message(row)
        turned = np.array(each.position) + 2.0 * np.pi * (row // 50 % 3)
        found.append(wrapped.take(each._replace(position=turned.tolist())))
    for one, other in zip(expected, found[1:], strict=True):
        assert other is not None
        np.testing.assert_allclose(other.external.torque, one.external.torque, atol=1e-6)


@pytest.mark.parametrize(('step', 'n_watched'), [(20, 49), (30, 0)])
def test_joint_states_at_the_longest_gap_are_watched_and_others_told(
    path: str, step: int, n_watched: int
) -> None:
    """At 5 Hz rounding decided which of the stamps was too far from the one before."""
    watching = monitor(path)
    watching.judge(0.0)
    assert len(take(watching, range(0, 50 * step, step))) == n_watched
    if n_watched:
        assert watching.judge(0.5) == (Level.OK, 'not calibrated')


def test_gaps_among_what_is_watched_are_told(path: str) -> None:
    watching = monitor(path)
    for first in (0, 50, 100):
        take(watching, range(first, first + 10))
    assert watching.judge(0.5) == (
        Level.WARN, '3 joint states not watched: they came more than 0.2 s apart'
    )  # fmt: skip


def test_the_reason_of_blindness_is_told_until_it_ends(path: str) -> None:
    watching = monitor(path)
    judged(watching, [message(100)] * 100)
    assert watching.judge(0.6) == (
        Level.ERROR, 'blind: joint states refused: stamp repeated 99'
    )  # fmt: skip
    take(watching, range(101, 110))
    assert watching.judge(0.7)[0] is Level.OK


def test_a_joint_that_is_named_twice_is_refused(path: str) -> None:
    twice = (*toy.JOINTS, toy.JOINTS[0])
    with pytest.raises(ConfigError, match="must name each joint once, but 'shoulder' comes twice"):
        monitor(path, joints=twice, deviation_constant=(1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ('changed', 'reason'),
    [
        ({'effort': []}, 'effort missing'),
        ({'velocity': []}, 'velocity missing'),
        ({'names': ('elbow', 'wrist')}, 'joint missing'),
        ({'names': ('wrist', 'finger')}, 'only foreign joints'),
        ({'position': [np.nan, 0.0]}, 'value not finite'),
        ({'velocity': [1e200, 0.0]}, 'torque not finite'),
        ({'effort': [1e200, 0.0]}, 'torque not finite'),  # its square is averaged
    ],
)
def test_what_cannot_be_used_is_counted_and_spoils_nothing(
    path: str, changed: dict[str, Any], reason: str
) -> None:
    watching = monitor(path)
    take(watching, range(100))
    with np.errstate(all='ignore'), pytest.raises(RefusedError):
        watching.take(message(100)._replace(**changed))
    assert watching.values()['refused'] == {reason: 1}
    after = take(watching, range(101, 200))
    assert len(after) >= 98
    assert np.abs([each.external.torque for each in after]).max() < 0.3


@pytest.mark.parametrize('shift_s', [0.0, 3600.0])
def test_another_robot_on_the_same_topic_disturbs_nothing(path: str, shift_s: float) -> None:
    watching = monitor(path)
    watching.judge(0.0)
    for row in range(100):
        with pytest.raises(RefusedError):
            watching.take(message(row, shift_s=shift_s)._replace(names=('finger', 'thumb')))
        watching.take(message(row))
    assert watching.values()['watched'] == 99
    assert watching.values()['refused'] == {'only foreign joints': 100}
    assert watching.judge(0.5) == (Level.OK, 'not calibrated')
    for row in range(3):
        with pytest.raises(RefusedError):
            watching.take(message(row)._replace(names=('finger', 'thumb')))
    level, summary = watching.judge(1.0)
    assert (level, summary) == (Level.ERROR, 'blind: joint states refused: only foreign joints 3')


def test_a_calibration_that_failed_gives_the_smallest_contacts_and_keeps_the_deviations(
    path: str,
) -> None:
    watching = monitor(path, smallest_contact=(1e-4,), deviation_constant=(0.15,))
    watching.contacts.calibrate()
    take(watching, range(600))
    values = watching.values()
    assert values['failure'].startswith(
        'not calibrated: contacts at shoulder 0.0001, elbow 0.0001'
    )
    assert values['deviation_constant'] == [0.15, 0.15]
    assert values['state'] == 'watching'
    shoulder, elbow = least = values['least_contact']
    assert f'shoulder {shoulder:g}, elbow {elbow:g} N m or N would' in values['failure']
    found = watching.contacts.outcome()[1]
    assert found['smallest_contact'] == least
    assert found['joints'] == list(toy.JOINTS)

    with pytest.raises(DataError, match='contacts at elbow'):
        watching.contacts.require_shown((shoulder, 0.9 * elbow))
    watching.contacts.require_shown(least)
    watching.contacts.find(least)
    values = watching.values()
    assert values['failure'] == ''
    np.testing.assert_allclose(values['deviation_constant'], found['deviation_constant'], 1e-3)
    assert any(touches(each) for each in take(watching, range(600, 630), contact=1.0))
    assert monitor(path, **found).values()['state'] == 'watching'


def test_without_a_calibration_contacts_of_any_size_are_taken(path: str) -> None:
    watching = monitor(path, deviation_constant=(0.2,), deviation_torque=(0.0,))
    watching.contacts.find((100.0,))
    assert not any(touches(each) for each in take(watching, range(300, 330), contact=1.0))
    with pytest.raises(ConfigError, match='smallest_contact must hold one value per joint'):
        watching.contacts.require_shown((1.0, 1.0, 1.0))
    assert watching.contacts.outcome()[1] == {}


def test_a_model_or_a_list_that_does_not_fit_is_refused(path: str) -> None:
    with pytest.raises(ModelError, match='must be a model of the joints a, b, but has shoulder'):
        monitor(path, joints=('a', 'b'))
    with pytest.raises(
        ConfigError, match=r'^deviation_constant must hold one value per joint \(2\)'
    ):
        monitor(path, deviation_constant=(1.0, 1.0, 1.0))
    with pytest.raises(FileNotFoundError):
        monitor(str(Path(path).with_name('none.npz')))


def judged(watching: Monitor, messages: list[JointMessage]) -> tuple[Level, str]:
    for each in messages:
        with contextlib.suppress(RefusedError):
            watching.take(each)
    return watching.judge(0.5)


@pytest.mark.parametrize(
    ('messages', 'summary'),
    [
        (
            [message(row) for row in range(0, 1000, 25)],
            'blind: joint states more than 0.2 s apart',
        ),
        ([message(100)] * 100, 'blind: joint states refused: stamp repeated 99'),
        (
            [message(row)._replace(effort=[]) for row in range(100)],
            'blind: joint states refused: effort missing 100',
        ),
        (
            [message(row)._replace(stamp_ns=0) for row in range(100)],
            'blind: joint states refused: stamp missing 100',
        ),
    ],
)
def test_a_blind_monitor_errs(path: str, messages: list[JointMessage], summary: str) -> None:
    watching = monitor(path)
    assert judged(watching, messages) == (Level.ERROR, summary)
    values = watching.values()
    used = sum(values[key] for key in ('watched', 'too_soon', 'after_a_gap'))
    assert values['received'] == len(messages) == used + sum(values['refused'].values())


def test_silence_is_an_error(path: str) -> None:
    watching = monitor(path)
    assert watching.judge(10.0)[0] is Level.OK
    assert watching.judge(13.0) == (Level.ERROR, 'blind: no joint states for 3 s')
    take(watching, range(50))
    assert watching.judge(14.0) == (Level.OK, 'not calibrated')
    assert watching.judge(17.0) == (Level.ERROR, 'blind: no joint states for 3 s')


def test_of_two_clocks_one_is_followed_and_the_other_warned_of(path: str) -> None:
    watching = monitor(path)
    pairs = [(message(row), message(row, shift_s=-3.0)) for row in range(300)]
    health = judged(watching, [each for pair in pairs for each in pair])
    assert health == (Level.WARN, 'joint states refused: stamp went back 300')
    assert watching.values()['watched'] == 299


def test_calibration_needs_motion(path: str) -> None:
    watching = monitor(path)
    watching.contacts.calibrate()
    for number in range(600):
        stamp = START_NS + 10_000_000 * number
        watching.take(JointMessage(stamp, toy.JOINTS, [0.1, 0.2], [0.0, 0.0], [0.8, 0.6]))
    failure = watching.values()['failure']
    assert failure.startswith('not calibrated: the velocity of shoulder must span ')
    assert 'but spanned 0; call calibrate and move all joints.' in failure
    assert watching.values()['deviation_constant'] is None
    assert watching.judge(0.0) == (Level.ERROR, failure)


def test_updates_are_followed_where_that_is_asked_for_and_the_model_comes_back(path: str) -> None:
    model = InverseDynamicsModel.load(path)
    assert model.arm is not None
    heavier = np.concatenate([1.2 * model.arm.links.ravel(), model.arm.friction.coefficients])
    update = message_of(Update(model.fingerprint, heavier, True))
    plain = monitor(path)
    plain.take_update(update, 0.0, 0)
    follows = monitor(path, follow_adaptation=True, blend_s=0.0, adaptation_limit=(5.0,))
    follows.take_update(update, 0.0, 0)
    expected = take(plain, range(100))[-1].external.torque
    found = take(follows, range(100))[-1].external.torque
    np.testing.assert_allclose(found - expected, -0.2 * TAU[99], atol=0.5)
    assert follows.values()['adaptation']['model'] == 'adapted'
    assert plain.values()['adaptation'] == {}
    assert follows.judge(1.0)[0] is Level.OK
    with pytest.raises(RefusedError):
        follows.take_update(update, 1.0, 10**10)
    assert follows.judge(1.1) == (Level.WARN, 'updates refused: update too old 1')
    take(follows, range(100, 102))
    level, sentence = follows.judge(6.0)
    assert level is Level.WARN
    assert sentence.startswith('follows the commissioned model: no update for 5 s; start adapt')
    assert follows.values()['adaptation']['model'] == 'commissioned'


def test_friction_is_that_of_drives(tmp_path: Path) -> None:
    """Torques come without the low-pass of the recording, which softens friction at reversals."""
    found = []
    for rise_time in (0.0, 0.5):
        fitted, file = known_model().with_rise_time(rise_time), str(tmp_path / f'{rise_time}.npz')
        fitted.save(file)
        watching = Monitor(MonitorSettings(model_path=file))
        data = stream(known_model(), 3.0, seed=0)
        for t, q, dq, tau in zip(data.t, data.q, data.dq, data.tau, strict=True):
            stamp = START_NS + round(1e9 * t)
            signals = (q.tolist(), dq.tolist(), tau.tolist())
            watched = watching.take(JointMessage(stamp, fitted.joint_names, *signals))
        assert watched is not None
        found.append(watched.external.torque)
    np.testing.assert_array_equal(found[0], found[1])
