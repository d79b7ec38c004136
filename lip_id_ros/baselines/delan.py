"""Training of a deep Lagrangian network, with the sizes of the paper's table."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from torch.optim.lr_scheduler import OneCycleLR

from lip_id_ros.arrays import Array
from lip_id_ros.baselines.delan_network import DelanNetwork
from lip_id_ros.baselines.interface import Answer
from lip_id_ros.dataset import Dataset
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

WIDTH, DEPTH = 64, 3
BATCH = 100
PEAK_RATE, DECAY = 5e-3, 1e-5
WARM_UP = 0.1
"""
Share of the steps in which the learning rate grows to its peak; it then falls to nothing. The
paper's constant rate of 5e-4 is for ten million steps, and learns little in a few thousand.
"""

STEPS = 3000
REPORT_EVERY = 50
STAGE = 'network'


class Delan:
    """
    Deep Lagrangian network; all samples, no friction, which its own paper leaves out too.

    Parameters
    ----------
    steps : int
        Steps of the optimiser, each on `BATCH` samples. The paper takes 2e5 epochs, of 5000
        samples: ten million steps.

    """

    def __init__(self, steps: int = STEPS) -> None:
        self._steps = steps

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Network:
        """Train on inverse dynamics and power conservation."""
        with torch.random.fork_rng(devices=[]), _one_thread():
            torch.manual_seed(settings.seed)
            prismatic = [kind == 'prismatic' for kind in dataset.joint_types]
            network = DelanNetwork(prismatic, WIDTH, DEPTH)
            _train(network, dataset, self._steps, progress)
        return Network(network)


class Network:
    """
    A trained network.

    Parameters
    ----------
    network : DelanNetwork

    """

    def __init__(self, network: DelanNetwork) -> None:
        self._keep(network)

    def _keep(self, network: DelanNetwork) -> None:
        self._network = network.eval()
        self.size = sum(int(weights.numel()) for weights in network.parameters())

    def __getstate__(self) -> dict[str, Any]:
        """Return what describes it."""
        return {'shape': self._network.shape, 'weights': dict(self._network.state_dict())}

    def __setstate__(self, description: dict[str, Any]) -> None:
        """Set it up again; see `lip_id_ros.baselines.taken_apart`."""
        network = DelanNetwork(*description['shape'])
        network.load_state_dict(description['weights'])
        self._keep(network)

    def predict(self, q: Array, dq: Array, ddq: Array) -> Answer:
        """Estimate torques and both energies."""
        motion = [torch.from_numpy(np.array(x)) for x in (q, dq, ddq)]
        with torch.no_grad():
            tau = self._network.torque(*motion)
            kinetic = self._network.kinetic(*motion[:2])
            potential = self._network.potential(motion[0])
        return Answer(*(np.asarray(x.numpy()) for x in (tau, kinetic, potential)))


@contextmanager
def _one_thread() -> Iterator[None]:
    # Products this small gain nothing from more threads, which on a busy machine wait for each
    # other all the time.
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _train(network: DelanNetwork, dataset: Dataset, steps: int, progress: Progress) -> None:
    samples = [torch.tensor(x) for x in (dataset.q, dataset.dq, dataset.ddq, dataset.tau)]
    torque_variance = samples[3].var(0).clamp_min(torch.finfo(torch.float64).tiny)
    power_variance = (samples[3] * samples[1]).sum(1).var()
    optimiser = torch.optim.Adam(network.parameters(), weight_decay=DECAY)
    schedule = OneCycleLR(optimiser, PEAK_RATE, total_steps=steps, pct_start=WARM_UP)
    for step in range(steps):
        rows = torch.randint(dataset.n_samples, (min(BATCH, dataset.n_samples),))
        q, dq, ddq, tau = (x[rows] for x in samples)
        error = network.torque(q, dq, ddq) - tau
        # d(T + V)/dt of the network is dq^T times its torque: its power error is dq^T error
        inverse_dynamics = (error.square() / torque_variance).mean()
        power = (error * dq).sum(1).square().mean() / power_variance
        optimiser.zero_grad()
        (inverse_dynamics + power).backward()
        optimiser.step()
        schedule.step()
        if step % REPORT_EVERY == 0:
            progress(STAGE, step, steps)
    progress(STAGE, steps, steps)
