import numpy as np
import pytest
from scipy.signal import lfilter

from loop.errors import PoorExcitation
from loop.open_loop import process_output, step_response
from loop.process import (
    FOPDT,
    IPDT,
    SOPDT,
    DoubleIntegrator,
    Process,
    PureDelay,
    TransferFunction,
    static_gain,
)
from loop.process_variation import varied
from loop.pulse_transfer import pulse_transfer
from loop.sampled_response import held_response

PROCESSES = [
    FOPDT(K=2.0, tau=20.0, theta=3.4),
    SOPDT(K=-1.0, tau1=400.0, tau2=30.0, theta=0.0),
    IPDT(K=0.01, theta=6.0),
    DoubleIntegrator(K=1e-3, theta=2.2),
    PureDelay(K=2.0, theta=3.4),
    TransferFunction((-2.0, 1.0), (8.0, 12.0, 6.0, 1.0), 1.2),
    TransferFunction((1.0,), (5.0, 1.0, 0.0), 1.0),
    TransferFunction((3.0,), (1.0,), 2.5),
]


@pytest.mark.parametrize("process", PROCESSES)
def test_the_difference_equation_answers_as_the_exact_motion_does(process: Process) -> None:
    op = np.random.default_rng(1).normal(size=200)
    transfer = pulse_transfer(process, 1.0)
    found = lfilter(transfer.b, transfer.a, transfer.delayed(op - op[0]))
    exact = process_output(process, np.arange(200.0), op)
    np.testing.assert_allclose(found, exact, atol=1e-7 * np.max(np.abs(exact)))


@pytest.mark.parametrize("process", PROCESSES)
def test_its_frequency_response_is_that_of_the_sampled_process(process: Process) -> None:
    transfer, z = pulse_transfer(process, 1.0), np.exp(1j * np.geomspace(1e-3, 3, 20))
    P = transfer.numerator(z) / transfer.denominator(z)
    np.testing.assert_allclose(P, held_response(process, z, dt=1.0), rtol=1e-7)


def test_an_order_too_high_for_the_scan_is_refused() -> None:
    slow = TransferFunction((1.0,), tuple(np.poly([-1e-4] * 5) / 1e-20))
    with pytest.raises(PoorExcitation, match="too fine for a model of so high an order"):
        pulse_transfer(slow, 0.01)


@pytest.mark.parametrize("process", PROCESSES)
def test_factors_move_gain_lags_and_dead_time_and_nothing_else(process: Process) -> None:
    t = np.linspace(0.0, 4000.0, 801)[1:]
    before = step_response(process, t)
    np.testing.assert_allclose(step_response(varied(process, K=1.5), t), 1.5 * before)
    # all times together are a change of the time unit
    integrators = len(process.denominator) - 1 - int(np.flatnonzero(process.denominator)[-1])
    slower = varied(process, lag=2.0, theta=2.0)
    np.testing.assert_allclose(
        step_response(slower, 2 * t), before * 2.0**integrators, rtol=1e-6, atol=1e-9
    )
    assert static_gain(slower) == pytest.approx(static_gain(process))
    assert varied(process) == process
