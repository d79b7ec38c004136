"""
Deep Lagrangian network (Lutter, Ritter and Peters 2019): energies as networks.

T = dq^T L L^T dq / 2 with a lower triangular L(q) and V(q), each a feedforward network of the
features of q; torques by the Euler-Lagrange equations, differentiated by torch. Trained with the
sizes of the paper's table.

"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import numpy as np
import torch
from torch import nn
from torch.optim.lr_scheduler import OneCycleLR

from benchmarks.baselines import Baseline, Methods
from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.model import TorquePrediction
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

LEAST_INERTIA = 1e-4  # added to the diagonal of L after softplus
OUTPUT_GAIN = 0.1
"""
Of the last layers' initial weights: L begins as nearly constant and diagonal. With couplings at
random, the first steps can silence a joint by driving its diagonal entry to nothing, for good.
"""


class Delan:
    """
    Deep Lagrangian network; all samples, no friction, which its own paper leaves out too.

    `steps` are those of the optimiser, each on `BATCH` samples. The paper takes 2e5 epochs of 5000
    samples: ten million steps.

    """

    def __init__(self, steps: int = STEPS) -> None:
        self._steps = steps

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Network:
        """Train on inverse dynamics and power conservation."""
        with torch.random.fork_rng(devices=[]), _one_thread():
            torch.manual_seed(settings.seed)
            network = DelanNetwork(dataset.prismatic, WIDTH, DEPTH)
            _train(network, dataset, self._steps, progress)
        return Network(dataset.joint_names, dataset.joint_types, network)


class Network(Baseline):
    """A trained network."""

    has_potential = True

    def __init__(
        self, joint_names: tuple[str, ...], joint_types: tuple[str, ...], network: DelanNetwork
    ) -> None:
        super().__init__(joint_names, joint_types)
        self._network = network.eval()

    @property
    def size(self) -> int:
        """Number of weights."""
        return sum(int(weights.numel()) for weights in self._network.parameters())

    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        """Return torques and both energies."""
        motion = [torch.from_numpy(np.array(x)) for x in (q, dq, ddq)]
        with torch.no_grad():
            tau = self._network.torque(*motion)
            kinetic = self._network.kinetic(*motion[:2])
            potential = self._network.potential(motion[0])
        return TorquePrediction(*(np.asarray(x.numpy()) for x in (tau, kinetic, potential)))


METHODS: Methods = {'delan': lambda _: Delan()}


class DelanNetwork(nn.Module):
    """
    The two networks, with hidden layers of `width` and `depth`.

    `prismatic` marks the joints, shape (n,), whose positions enter as they are; the others enter
    as cosine and sine.

    """

    def __init__(self, prismatic: BoolArray, width: int, depth: int) -> None:
        super().__init__()
        self.width, self.depth = width, depth
        n = len(prismatic)
        self.register_buffer('_prismatic', torch.tensor(prismatic))
        rows, columns = torch.tril_indices(n, n)
        self.register_buffer('_diagonal', rows == columns)
        self.register_buffer('_place', n * rows + columns)
        self._inertia = _feedforward(2 * n, n * (n + 1) // 2, width, depth)
        self._potential = _feedforward(2 * n, 1, width, depth)

    def torque(self, q: torch.Tensor, dq: torch.Tensor, ddq: torch.Tensor) -> torch.Tensor:
        """Return d/dt (dL/d dq) - dL/dq, all of shape (N, n)."""
        _, momentum_rate = torch.func.jvp(self._momentum, (q, dq), (dq, ddq))
        by_position = torch.func.grad(self._total_lagrangian)(q, dq)
        return momentum_rate - by_position

    def kinetic(self, q: torch.Tensor, dq: torch.Tensor) -> torch.Tensor:
        """Return T, shape (N,), never negative."""
        return 0.5 * (self._cholesky(q).transpose(1, 2) @ dq[..., None]).square().sum((1, 2))

    def potential(self, q: torch.Tensor) -> torch.Tensor:
        """Return V, shape (N,)."""
        return self._potential(self._features(q)).squeeze(1)

    def _momentum(self, q: torch.Tensor, dq: torch.Tensor) -> torch.Tensor:
        factor = self._cholesky(q)
        return (factor @ (factor.transpose(1, 2) @ dq[..., None])).squeeze(2)

    def _total_lagrangian(self, q: torch.Tensor, dq: torch.Tensor) -> torch.Tensor:
        return (self.kinetic(q, dq) - self.potential(q)).sum()

    def _cholesky(self, q: torch.Tensor) -> torch.Tensor:
        n = q.shape[1]
        entries = self._inertia(self._features(q))
        positive = nn.functional.softplus(entries) + LEAST_INERTIA
        entries = torch.where(self._diagonal, positive, entries)
        flat = torch.zeros(len(q), n * n, dtype=q.dtype, device=q.device)
        return flat.index_add(1, self._place, entries).reshape(-1, n, n)

    def _features(self, q: torch.Tensor) -> torch.Tensor:
        first = torch.where(self._prismatic, q, torch.cos(q))
        second = torch.where(self._prismatic, torch.zeros_like(q), torch.sin(q))
        return torch.cat([first, second], dim=1)


def _feedforward(n_inputs: int, n_outputs: int, width: int, depth: int) -> nn.Sequential:
    sizes = [n_inputs] + [width] * depth
    layers: list[nn.Module] = []
    for before, after in pairwise(sizes):
        layers += [nn.Linear(before, after), nn.Softplus()]
    last = nn.Linear(sizes[-1], n_outputs)
    network = nn.Sequential(*layers, last).double()
    for layer in network:
        if isinstance(layer, nn.Linear):
            nn.init.xavier_normal_(layer.weight, OUTPUT_GAIN if layer is last else 1.0)
            nn.init.zeros_(layer.bias)
    return network


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
