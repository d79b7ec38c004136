"""The likelihood on a device against the compiled one, and where there is no device."""

from __future__ import annotations

from dataclasses import replace
import subprocess
import sys

from gp.arms import ARMS as PHYSICAL_ARMS
from gp.arms import dataset_of, random_motion
from gp.cases import P, R, random_likelihood, TYPES, without_gravity
from gp.processes import process_of
from kernels.cases import MEMBERS
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import FitError
from lip_id_ros.gp.fitting import make_kernel
from lip_id_ros.gp.initialisation import initial_hyperparameters
from lip_id_ros.gp.likelihood import MarginalLikelihood
from lip_id_ros.gp.training import maximise, Objective
from lip_id_ros.identification import fit
from lip_id_ros.kernels import TorquePrior
from lip_id_ros.settings import FitSettings

torch = pytest.importorskip('torch', reason='the device path needs torch')

from lip_id_ros.gp.reference import CHUNK_BYTES, TorchMarginalLikelihood  # noqa: E402

pytestmark = pytest.mark.slow

DEVICES = ('cpu', pytest.param('cuda', marks=pytest.mark.gpu))
ARMS = ((R,), (P,), (P, R), (R, R, P, R))


def on_device(
    likelihood: MarginalLikelihood, device: str, chunk_bytes: int = CHUNK_BYTES
) -> TorchMarginalLikelihood:
    return TorchMarginalLikelihood(
        likelihood.kernel,
        likelihood.states,
        likelihood.tau,
        likelihood.like,
        device,
        chunk_bytes,
    )


def assert_same(likelihood: MarginalLikelihood, other: TorchMarginalLikelihood) -> None:
    at = likelihood.like.vector()
    gram = TorquePrior(likelihood.kernel, likelihood.like).gram(likelihood.states)
    np.testing.assert_allclose(other.gram(at), gram, rtol=1e-9, atol=1e-11 * np.abs(gram).max())
    value, gradient = likelihood.value_and_gradient(at)
    same_value, same_gradient = other.value_and_gradient(at)
    assert same_value == pytest.approx(value, rel=1e-9)
    atol = 1e-10 * np.abs(gradient).max()
    np.testing.assert_allclose(same_gradient, gradient, rtol=1e-9, atol=atol)


@pytest.mark.parametrize('device', DEVICES)
@pytest.mark.parametrize('friction', [False, True])
@pytest.mark.parametrize('member', MEMBERS)
def test_likelihood_and_gradient(member: str, friction: bool, device: str) -> None:
    likelihood = random_likelihood(member, TYPES, friction, 11)
    assert_same(likelihood, on_device(likelihood, device))


@pytest.mark.parametrize('device', DEVICES)
@pytest.mark.parametrize('types', ARMS)
@pytest.mark.parametrize('member', MEMBERS)
def test_arms(member: str, types: tuple[str, ...], device: str) -> None:
    likelihood = random_likelihood(member, types, True, 7)
    assert_same(likelihood, on_device(likelihood, device))


@pytest.mark.parametrize('device', DEVICES)
@pytest.mark.parametrize('member', MEMBERS)
def test_without_gravity(member: str, device: str) -> None:
    likelihood = without_gravity(random_likelihood(member, TYPES, True, 9))
    assert_same(likelihood, on_device(likelihood, device))


@pytest.mark.parametrize('chunk_bytes', [1, 600_000])
def test_chunks_make_no_difference(chunk_bytes: int) -> None:
    likelihood = random_likelihood('recursive', TYPES, True, 4)
    assert_same(likelihood, on_device(likelihood, 'cpu', chunk_bytes))


def test_a_gram_matrix_that_is_not_finite() -> None:
    likelihood = random_likelihood('recursive', TYPES, False, 5)
    vector = likelihood.like.vector()
    vector[-len(TYPES) :] = np.nan  # of the noise
    with pytest.raises(FitError, match='Gram matrix was expected to be finite'):
        on_device(likelihood, 'cpu').value_and_gradient(vector)


def test_a_singular_gram_matrix_is_refused() -> None:
    likelihood = random_likelihood('recursive', TYPES, False, 5)
    vector = likelihood.like.vector()
    vector[:] = -np.inf  # every hyperparameter 0
    with pytest.raises(FitError, match='Gram matrix was expected to be positive definite'):
        on_device(likelihood, 'cpu').value_and_gradient(vector)


def motions() -> Dataset:
    """Return motions of the polar arm with a little noise."""
    arm = PHYSICAL_ARMS['polar']
    motion = random_motion(arm, 16, seed=0)
    tau = arm.torque(*motion)
    noise = 0.01 * np.random.default_rng(1).normal(size=tau.shape)
    return dataset_of(arm, motion, tau + noise)


@pytest.mark.slow
@pytest.mark.parametrize('device', DEVICES)
def test_optimum_is_the_same(device: str) -> None:
    """With a prior that makes it sharp: along flat directions rounding moves it by more."""
    dataset, settings = motions(), FitSettings(prior_precision=1.0)
    kernel = make_kernel(dataset, settings, 'recursive')
    start = initial_hyperparameters(kernel, dataset)
    states = kernel.states(dataset.q, dataset.dq, dataset.ddq)
    likelihood = MarginalLikelihood(kernel, states, dataset.tau, start)
    found, same = (
        maximise(Objective(one, start, settings.prior_precision), start, 200)
        for one in (likelihood, on_device(likelihood, device))
    )
    assert same.converged
    assert found.converged
    assert same.value == pytest.approx(found.value, rel=1e-8)
    np.testing.assert_allclose(
        same.hyperparameters.vector(), found.hyperparameters.vector(), atol=1e-6
    )


@pytest.mark.gpu
def test_fit_on_a_gpu() -> None:
    settings, data = FitSettings(iterations=200, kernel='recursive'), motions()
    model, on_cpu = fit(data, replace(settings, device='cuda')), fit(data, settings)
    assert (model.summary['device'], model.summary['device_note']) == ('cuda', '')
    tau, same_tau = (m.predict(data.q, data.dq, data.ddq).tau for m in (on_cpu, model))
    np.testing.assert_allclose(same_tau, tau, atol=1e-6 * np.abs(tau).max())


@pytest.mark.skipif(torch.cuda.is_available(), reason='needs a machine without a CUDA device')
def test_fit_without_a_gpu_says_so() -> None:
    settings = FitSettings(kernel='recursive', iterations=2, device='cuda')
    model, on_cpu = fit(motions(), settings), fit(motions(), replace(settings, device='cpu'))
    assert model.summary['device'] == 'cpu'
    assert model.summary['device_note'] == (
        'Fitted on the CPU instead of cuda: torch finds no CUDA device.'
    )
    assert on_cpu.summary['device_note'] == ''
    np.testing.assert_array_equal(process_of(model).alpha, process_of(on_cpu).alpha)


def test_without_torch_says_so() -> None:
    """In a process of its own, in which torch cannot be imported."""
    program = (
        "import sys; sys.modules['torch'] = None\n"
        'from lip_id_ros.gp.likelihood import choose\n'
        "print(choose('cuda').device, choose('cuda').note)"
    )
    ran = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=True
    )
    assert ran.stdout.startswith('cpu Fitted on the CPU instead of cuda: torch cannot be imported')
