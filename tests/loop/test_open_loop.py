"""Open-loop answers against closed forms, scipy and python-control."""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from loop.open_loop import process_output, step_response
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, TransferFunction
from loop.sampled_process import sampled, scans_in
from loop.signals import Real

T = np.arange(0, 60, 0.25)


def after(theta: float) -> Real:
    return np.maximum(T - theta, 0.0)


@pytest.mark.parametrize(
    ("process", "printed"),
    [
        (FOPDT(K=2, tau=12, theta=3.1), 2 * (1 - np.exp(-after(3.1) / 12))),
        (IPDT(K=-0.5, theta=2.03), -0.5 * after(2.03)),
        (DoubleIntegrator(K=3, theta=0), 1.5 * T**2),
        (
            SOPDT(K=1, tau1=5, tau2=2, theta=1.3),
            1 - (5 * np.exp(-after(1.3) / 5) - 2 * np.exp(-after(1.3) / 2)) / 3,
        ),
        (
            SOPDT(K=1, tau1=4, tau2=4, theta=0.2),
            1 - (1 + after(0.2) / 4) * np.exp(-after(0.2) / 4),
        ),
        (TransferFunction((3.0,), (2.0,)), np.full(T.size, 1.5)),
        (TransferFunction((1.0,), (1.0, 0.0, 0.0, 0.0), 0.4), after(0.4) ** 3 / 6),
        (  # inverse response with direct feedthrough: (1 - 2s)/(1 + 5s)
            TransferFunction((-2.0, 1.0), (5.0, 1.0), 1.1),
            np.where(T >= 1.1, 1 - 1.4 * np.exp(-after(1.1) / 5), 0.0),
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_step_answers_as_the_textbook_prints(process: Process, printed: Real) -> None:
    np.testing.assert_allclose(step_response(process, T), printed, atol=1e-11, rtol=1e-11)


def test_a_third_order_plant_agrees_with_python_control() -> None:
    plant = TransferFunction((2.0, 3.0), (4.0, 9.0, 5.0, 1.0))
    op = np.random.default_rng(3).normal(size=T.size)
    op[0] = 0.0
    # Held inputs are exact in a zero-order-hold equivalent, so python-control is exact here too.
    held = control.sample_system(control.tf([2, 3], [4, 9, 5, 1]), 0.25, method="zoh")
    second = control.forced_response(held, T, op).outputs
    np.testing.assert_allclose(process_output(plant, T, op), second, atol=1e-9)


def test_an_oscillating_plant_agrees_with_scipy() -> None:
    _, second = signal.step(([250.0], [1.0, 0.3, 40.0]), T=T)
    found = step_response(TransferFunction((250.0,), (1.0, 0.3, 40.0)), T)
    np.testing.assert_allclose(found, second, atol=1e-9 * 12)


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    theta=st.floats(0, 5),
    tau1=st.floats(0.1, 30),
    ratio=st.floats(0.01, 1),
)
def test_uneven_samples_and_dead_times_between_samples_are_superposed_steps(
    seed: int, theta: float, tau1: float, ratio: float
) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.01, 2, 25))
    op = rng.normal(size=25)
    theta = theta if theta > 1e-6 else 0.0
    for process in (
        FOPDT(K=2, tau=tau1, theta=theta),
        SOPDT(K=2, tau1=tau1, tau2=ratio * tau1, theta=theta),
    ):
        expected = np.full(25, 7.0)
        for at, move in zip(t, np.diff(op, prepend=0.4), strict=True):
            late = np.maximum(t - at, 0.0)
            expected += move * step_at(process, late)
        found = process_output(process, t, op, op_before=0.4, pv0=7.0)
        np.testing.assert_allclose(found, expected, atol=1e-8)


def step_at(process: FOPDT | SOPDT, t: Real) -> Real:
    s = np.maximum(t - process.theta, 0.0)
    if isinstance(process, FOPDT):
        return np.asarray(process.K * -np.expm1(-s / process.tau))
    a, b = process.tau1, process.tau2
    if math.isclose(a, b, rel_tol=1e-6):
        return np.asarray(process.K * (1 - (1 + s / a) * np.exp(-s / a)))
    return np.asarray(process.K * (1 - (a * np.exp(-s / a) - b * np.exp(-s / b)) / (a - b)))


def test_a_process_at_rest_stays_there() -> None:
    found = process_output(FOPDT(K=2, tau=5, theta=1), T, np.full(T.size, 41.5), pv0=63.0)
    assert np.all(found == 63.0)


def test_a_single_sample_and_a_late_start_are_answered() -> None:
    process = FOPDT(K=1, tau=1, theta=0)
    assert process_output(process, np.array([0.0]), np.array([3.0]), pv0=2.0) == [2.0]
    assert step_response(process, np.array([1.0])) == pytest.approx([1 - math.exp(-1)])


@pytest.mark.parametrize(
    ("t", "op", "words"),
    [
        ([0, 1], [1.0], "equally long"),
        ([], [], "equally long"),
        ([0, 1], [1.0, math.nan], "gaps"),
        ([0, 1, 1], [1.0, 2, 3], "increase strictly"),
    ],
)
def test_impossible_records_are_refused_in_words(
    t: list[float], op: list[float], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        process_output(IPDT(K=1, theta=0), np.array(t), np.array(op))


@pytest.mark.parametrize("t", [[], [-1.0, 0.0]])
def test_a_step_response_starts_at_its_step(t: list[float]) -> None:
    with pytest.raises(ValueError, match="from 0 on"):
        step_response(IPDT(K=1, theta=0), np.array(t))


@pytest.mark.parametrize("theta", [0.0, 0.3, 0.37, 1.0])
def test_the_sampled_process_is_the_open_loop_answer(theta: float) -> None:
    """0.3 s is three scans of 0.1 s although 0.3/0.1 is below 3 in floats."""
    process = SOPDT(K=2, tau1=3, tau2=1, theta=theta)
    op = np.random.default_rng(1).normal(size=50)
    plant = sampled([process], 0.1)
    assert plant.q[0] == [0, 3, 3, 10][[0.0, 0.3, 0.37, 1.0].index(theta)]
    x, found, q = np.zeros(2), [], int(plant.q[0])
    delayed = np.concatenate([np.zeros(q + 1), op])
    for k in range(50):
        found.append(plant.C[0] @ x)
        x = plant.Phi[0] @ x + plant.late[0] * delayed[k] + plant.early[0] * delayed[k + 1]
    exact = process_output(process, np.arange(50) * 0.1, op, op_before=0.0)
    np.testing.assert_allclose(found, exact, atol=1e-12)


def test_both_ends_of_a_span_are_scanned() -> None:
    assert scans_in(0.3, 0.1) == 4
    assert scans_in(1.0, 0.4) == 3
