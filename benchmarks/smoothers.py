"""
Smoothers of quantised positions: quintic splines, and a Kalman filter with its backward pass.

Velocities are hidden. Smoothed positions, velocities and accelerations go through the low-pass of
the torques; rigid links with true kinematics and selected friction are fitted to them and predict
the unseen torques. Errors are in those of the usual low-pass.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
import math
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline, make_splrep
from scipy.optimize import minimize_scalar

from benchmarks._real import ARMS, RealArm, SPLITS
from benchmarks._simulated_recordings import N_JOINTS, simulated
from benchmarks.baselines import method
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.numba_jit import jit
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.preprocessing.sample_times import roughness
from lip_id_ros.preprocessing.segment import Segment
from lip_id_ros.preprocessing.segments import quantum, segments_of
from lip_id_ros.preprocessing.smoothing import is_long_enough, low_pass, uniform_times
from lip_id_ros.progress import silent
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import FitSettings, PreprocessingSettings, RecordingSettings

STEPS, SEEDS = (1e-5, 1e-4, 1e-3), 3
"""Of simulated recordings: quantisation [rad], and how many."""

MOST_HZ = 200.0
"""Positions at higher rates are averaged in groups first."""

ORDER = 4
"""Of the Kalman filter: position, velocity, acceleration and jerk, which is a random walk."""

UNKNOWN = 1e10
"""Variance of the first state, in those of a measurement."""

DECADES = (-16.0, 4.0)
"""Of the random walk's variance per step, in those of a measurement."""

Smoother = Callable[[Array, Array, float, Array], tuple[Array, Array, Array]]
"""
From times (N,), positions (N,), the variance of their errors and times (K,) to positions,
velocities and accelerations, (K,) each.
"""


def main(arguments: list[str]) -> int:
    """Print errors of every smoother, in those of the low-pass with Savitzky-Golay."""
    parser = argparse.ArgumentParser(prog='benchmarks smoothers', description=__doc__)
    parser.add_argument('--data', type=Path, default=Path('../shared/data'))
    parser.add_argument('--arms', nargs='*', default=list(ARMS))
    options = parser.parse_args(arguments)
    for step in STEPS:
        mean = np.mean([_simulated_errors(seed, step) for seed in range(SEEDS)], axis=0)
        print(f'simulated, steps of {step:g} rad: {np.round(mean, 3)} %', flush=True)
    ratios = []
    for name in options.arms:
        for unseen in SPLITS:
            errors = _held_out_errors(options.data, ARMS[name], unseen)
            ratios.append([np.exp(np.log(each / errors[0]).mean()) for each in errors])
            print(f'{name}, {unseen} 30 %: {np.round(ratios[-1], 3)}', flush=True)
            print(np.round(errors, 3))
    names = ('low-pass, Savitzky-Golay', *SMOOTHERS)
    means = np.exp(np.log(np.array(ratios)).mean(axis=0))
    print(dict(zip(names, np.round(means, 3).tolist(), strict=True)))
    return 0


def _simulated_errors(seed: int, step: float) -> list[float]:
    """Return errors of true torques at states that are found in quantised positions [%]."""
    recorded = simulated(seed, np.zeros(N_JOINTS), coulomb=0.0)
    position = step * np.round(recorded.samples.position / step)
    samples = replace(recorded.samples, position=position)
    errors = []
    for data in _smoothed([samples], RecordingSettings()):
        truth = recorded.torque(*recorded.motion.sample(data.t))
        found = recorded.torque(data.q, data.dq, data.ddq)
        errors.append(float(100.0 * np.mean(np.std(found - truth, axis=0) / truth.std(axis=0))))
    return errors


def _held_out_errors(data: Path, arm: RealArm, unseen: str) -> list[Array]:
    """Return nMSE of unseen torques for every smoother, shape (n,) each [%]."""
    errors = []
    parts = [_smoothed(raw.samples, raw.recording) for raw in arm.raw_split(data, unseen)]
    for train, test in zip(*parts, strict=True):
        train, test = (replace(each, joint_names=arm.joints) for each in (train, test))
        model = method('rigid_body_friction', data / arm.urdf).fit(train, FitSettings(), silent)
        errors.append(nmse_percent(model.predict(test.q, test.dq, test.ddq).tau, test.tau))
    return errors


def _smoothed(recordings: Sequence[JointSamples], recording: RecordingSettings) -> list[Dataset]:
    """Return the data sets that positions alone give, by the usual derivative and by smoothers."""
    hidden = [replace(each, velocity=np.full_like(each.velocity, np.nan)) for each in recordings]
    usual = preprocess(hidden, recording=recording)
    found = [usual]
    for smoother in SMOOTHERS.values():
        segments = [
            _states(segment, smoother, usual.t[usual.segment == number])
            for number, segment in enumerate(_long_segments(hidden, recording))
        ]
        q, dq, ddq = (np.concatenate(each) for each in zip(*segments, strict=True))
        found.append(replace(usual, q=q, dq=dq, ddq=ddq))
    return found


def _long_segments(
    recordings: Sequence[JointSamples], recording: RecordingSettings
) -> Iterator[Segment]:
    usual = PreprocessingSettings()
    for samples in recordings:
        for segment in segments_of(samples, usual, recording)[0]:
            if is_long_enough(segment.t, segment.rate_hz, usual):
                yield segment


def _states(segment: Segment, smoother: Smoother, kept: Array) -> tuple[Array, Array, Array]:
    """Return positions, velocities and accelerations at some times, low-passed as usual."""
    rate_hz = segment.rate_hz
    times = uniform_times(segment.t, rate_hz)
    rows = np.searchsorted(times, kept - 0.5 / rate_hz)
    columns = []
    for position in segment.position.T:
        t, means, variance = grouped(segment.t, position)
        columns.append(smoother(t, means, variance, np.clip(times, t[0], t[-1])))
    signals = [np.stack(each, axis=1) for each in zip(*columns, strict=True)]
    cutoff = PreprocessingSettings().cutoff
    q, dq, ddq = (low_pass(each, rate_hz, cutoff)[rows] for each in signals)
    return q, dq, ddq


def grouped(t: Array, position: Array) -> tuple[Array, Array, float]:
    """Return times and positions at 200 Hz or less, and the variance of their errors."""
    size = max(1, round((t.size - 1) / (t[-1] - t[0]) / MOST_HZ))
    count = t.size // size
    step = quantum(position)
    noise = roughness(t, position[:, None]) / math.sqrt(2.0 / math.pi * 35.0 / 18.0)
    variance = step**2 / 12.0 if step > 0.0 else max(noise, 1e-12) ** 2
    means = [each[: count * size].reshape(count, size).mean(axis=1) for each in (t, position)]
    return means[0], means[1], variance / size


def fitted_spline(
    t: Array, position: Array, variance: float, times: Array
) -> tuple[Array, Array, Array]:
    """Evaluate a quintic spline with as few knots as the variance of the errors asks for."""
    spline = make_splrep(t, position, k=5, s=t.size * variance)
    return spline(times), spline.derivative(1)(times), spline.derivative(2)(times)


def rauch_tung_striebel(
    t: Array, position: Array, variance: float, times: Array
) -> tuple[Array, Array, Array]:
    """
    Evaluate the posterior mean of a motion whose jerk is a random walk.

    The variance of the walk is that of the largest marginal likelihood (Rauch, Tung and Striebel,
    Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3, 1965).

    """
    unit = float(np.median(np.diff(t)))
    steps, values = np.diff(t, prepend=t[0]) / unit, (position - position[0]) / math.sqrt(variance)
    found = minimize_scalar(
        lambda decade: -_filter(steps, values, 10.0**decade)[0], bounds=DECADES, method='bounded'
    )
    state = _smooth(steps, *_filter(steps, values, 10.0 ** float(found.x))[1:])
    spline = CubicSpline(t, state[:, :3] * math.sqrt(variance) / unit ** np.arange(3))
    q, dq, ddq = spline(times).T
    return q + position[0], dq, ddq


SMOOTHERS: Mapping[str, Smoother] = {
    'quintic spline, by quantisation': fitted_spline,
    'Rauch-Tung-Striebel': rauch_tung_striebel,
}


@jit
def _transition(step: float, walk: float) -> tuple[Array, Array]:
    """Return the matrix of a step and the covariance that it adds."""
    move, noise = np.zeros((ORDER, ORDER)), np.zeros((ORDER, ORDER))
    factorial = np.array([1.0, 1.0, 2.0, 6.0])
    for i in range(ORDER):
        for j in range(ORDER):
            if j >= i:
                move[i, j] = step ** (j - i) / factorial[j - i]
            power = 2 * ORDER - 1 - i - j
            below = factorial[ORDER - 1 - i] * factorial[ORDER - 1 - j]
            noise[i, j] = walk * step**power / (below * power)
    return move, noise


@jit
def _filter(steps: Array, values: Array, walk: float) -> tuple[float, Array, Array, float]:
    """Return the logarithm of the marginal likelihood, filtered states and covariances."""
    count = len(values)
    states, covariances = np.zeros((count, ORDER)), np.zeros((count, ORDER, ORDER))
    state, covariance, likelihood = np.zeros(ORDER), UNKNOWN * np.eye(ORDER), 0.0
    for row in range(count):
        if row > 0:
            move, noise = _transition(steps[row], walk)
            state = move @ state
            covariance = move @ covariance @ move.T + noise
        variance = covariance[0, 0] + 1.0
        gain, error = covariance[:, 0] / variance, values[row] - state[0]
        state = state + gain * error
        left = np.eye(ORDER)
        left[:, 0] -= gain
        covariance = left @ covariance @ left.T + np.outer(gain, gain)  # Joseph's form
        likelihood -= 0.5 * (error * error / variance + np.log(variance))
        states[row], covariances[row] = state, covariance
    return likelihood, states, covariances, walk


@jit
def _smooth(steps: Array, states: Array, covariances: Array, walk: float) -> Array:
    """Return the states given all values."""
    smooth = states.copy()
    for row in range(len(states) - 2, -1, -1):
        move, noise = _transition(steps[row + 1], walk)
        ahead = move @ covariances[row] @ move.T + noise
        gain = np.linalg.solve(ahead, move @ covariances[row]).T
        smooth[row] = states[row] + gain @ (smooth[row + 1] - move @ states[row])
    return smooth
