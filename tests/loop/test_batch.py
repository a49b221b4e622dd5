import math

import numpy as np
import pytest

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID, Action
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, TransferFunction


def test_every_lag_model_becomes_a_batch_of_one() -> None:
    for process, row in [
        (FOPDT(K=-2, tau=3, theta=1), (-2, 3, 0, 0, 1)),
        (SOPDT(K=2, tau1=3, tau2=1, theta=0), (2, 3, 1, 0, 0)),
        (IPDT(K=0.1, theta=2), (0.1, 0, 0, 1, 2)),
        (DoubleIntegrator(K=5, theta=0.5), (5, 0, 0, 2, 0.5)),
    ]:
        batch = ProcessBatch.of(process)
        assert batch.shape == ()
        found = (batch.K, batch.tau1, batch.tau2, batch.integrators, batch.theta)
        assert tuple(float(x) for x in found) == row


def test_a_controller_becomes_a_batch_of_one() -> None:
    batch = PIDBatch.of(PID(Kc=2, Ti=3, Td=1, N=5, tauF=0.5, action=Action.DIRECT))
    assert batch.shape == ()
    found = (batch.Kc, batch.Ti, batch.Td, batch.N, batch.tauF, batch.sign)
    assert tuple(float(x) for x in found) == (2, 3, 1, 5, 0.5, -1)
    assert float(PIDBatch(Kc=np.ones(2)).Ti) == math.inf


def test_factors_broadcast_over_a_process() -> None:
    batch = ProcessBatch.of(SOPDT(K=2, tau1=3, tau2=1, theta=4)).scaled(
        K=[[0.5], [1.5]], tau=[0.5, 1, 2], theta=0.25
    )
    assert batch.shape == (2, 3)
    np.testing.assert_array_equal(batch.K, [[1], [3]])
    np.testing.assert_array_equal(batch.tau1, [1.5, 3, 6])
    np.testing.assert_array_equal(batch.tau2, [0.5, 1, 2])
    assert batch.theta == 1


def test_a_general_transfer_function_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match="not a general transfer function"):
        ProcessBatch.of(TransferFunction((1,), (1, 1)))


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("K", 0.0, "K must lie within 1e-09 and 1e\\+09 in size, got 0.0"),
        ("K", math.nan, "K must lie"),
        ("tau1", -1.0, "tau1 must be 0 or lie within .* got -1.0"),
        ("tau2", 1e10, "tau2 must be 0 or"),
        ("theta", math.inf, "theta must be 0 or"),
        ("integrators", 3, "integrators must be 0, 1 or 2"),
    ],
)
def test_impossible_processes_are_refused_in_words(name: str, value: float, words: str) -> None:
    good = {"K": 1.0, "tau1": 1.0, "tau2": 0.0, "integrators": 0, "theta": 1.0}
    arrays = {key: np.asarray(x) for key, x in good.items()}
    arrays[name] = np.array([good[name], value])
    with pytest.raises(ValueError, match=words):
        ProcessBatch(**arrays)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("Kc", -1.0, "Kc must lie within .* got -1.0"),
        ("Ti", 0.0, "Ti must be infinite or"),
        ("Td", -0.1, "Td must lie within 0 and"),
        ("tauF", math.nan, "tauF must lie within 0 and"),
        ("N", 0.0, "N must be at least 1e-09"),
        ("sign", 0.0, "sign must be \\+1 or -1"),
    ],
)
def test_impossible_controllers_are_refused_in_words(name: str, value: float, words: str) -> None:
    arrays = {"Kc": np.asarray(1.0), name: np.array([1.0, value])}
    with pytest.raises(ValueError, match=words):
        PIDBatch(**arrays)


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        PIDBatch(Kc=np.ones(2), Ti=np.ones(3))
