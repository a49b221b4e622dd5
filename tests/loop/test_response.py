import math

import numpy as np
import pytest

from loop.controller import PID, Action, controller_response
from loop.margins import margins
from loop.process import FOPDT, IPDT, DoubleIntegrator, Process, TransferFunction, rational_response
from loop.response import (
    complementary_sensitivity,
    control_sensitivity,
    frequency_grid,
    load_sensitivity,
    loop_phase,
    loop_response,
    sensitivity,
)

W = np.geomspace(1e-3, 1e2, 200)
LOOPS: list[tuple[Process, PID]] = [
    (FOPDT(K=2, tau=12, theta=3), PID(Kc=0.45, Ti=13.5, Td=1.33)),
    (FOPDT(K=-2, tau=12, theta=0), PID(Kc=0.45, tauF=1, action=Action.DIRECT)),
    (DoubleIntegrator(K=1, theta=0.1), PID(Kc=0.2, Td=3, N=math.inf)),
    (TransferFunction((1, -2), (1, 0.2, 1), 0.3), PID(Kc=0.1, Ti=5, action=Action.DIRECT)),
    (TransferFunction((1,), (1, -1), 0.1), PID(Kc=3)),
]


@pytest.mark.parametrize(("process", "controller"), LOOPS)
def test_the_loop_is_process_times_controller_with_exact_dead_time(
    process: Process, controller: PID
) -> None:
    G = rational_response(process, 1j * W) * np.exp(-1j * W * process.theta)
    C = controller_response(controller, 1j * W)
    np.testing.assert_allclose(loop_response(process, controller, W), G * C, rtol=1e-11)
    np.testing.assert_allclose(sensitivity(process, controller, W), 1 / (1 + G * C), rtol=1e-10)
    T = complementary_sensitivity(process, controller, W)
    np.testing.assert_allclose(T, G * C / (1 + G * C), rtol=1e-10)
    load = load_sensitivity(process, controller, W)
    np.testing.assert_allclose(load, G / (1 + G * C), rtol=1e-10)
    noise = control_sensitivity(process, controller, W)
    np.testing.assert_allclose(noise, C / (1 + G * C), rtol=1e-10)


@pytest.mark.parametrize(("process", "controller"), LOOPS)
def test_the_phase_has_no_jumps_and_is_that_of_the_response(
    process: Process, controller: PID
) -> None:
    w = np.geomspace(1e-3, 1e2, 20_000)
    phase = loop_phase(process, controller, w)
    assert np.max(np.abs(np.diff(phase))) < 30
    turns = (phase - np.degrees(np.angle(loop_response(process, controller, w)))) / 360
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)


def test_frequencies_keep_their_shape() -> None:
    process, controller = LOOPS[0]
    for shape in ((), (3,), (2, 3)):
        w = np.full(shape, 0.1)
        assert loop_response(process, controller, w).shape == shape
        assert loop_phase(process, controller, w).shape == shape
        assert load_sensitivity(process, controller, w).shape == shape


def test_a_load_is_seen_even_at_an_undamped_resonance_of_the_process() -> None:
    # There G is infinite and G S = 1/C.
    process, controller = TransferFunction((1,), (1, 0, 1)), PID(Kc=2)
    assert load_sensitivity(process, controller, np.array([1.0]))[0] == pytest.approx(0.5)
    assert control_sensitivity(process, controller, np.array([1.0]))[0] == pytest.approx(0.0)


def test_on_the_stability_limit_the_peak_is_finite_but_enormous() -> None:
    # K Kc theta = pi/2 puts L(j) at -1.
    S = sensitivity(IPDT(K=1, theta=math.pi / 2), PID(Kc=1), np.array([1.0]))
    assert 1e15 < abs(S[0]) < math.inf
    on_it = sensitivity(DoubleIntegrator(K=1, theta=0), PID(Kc=1), np.array([1.0]))
    assert 1e15 < abs(on_it[0]) < math.inf


@pytest.mark.parametrize("w", [0.0, -1.0, math.nan, math.inf, 1e80])
def test_impossible_frequencies_are_refused_in_words(w: float) -> None:
    with pytest.raises(ValueError, match="frequencies must lie within"):
        loop_response(*LOOPS[0], np.array([1.0, w]))


@pytest.mark.parametrize(
    ("process", "controller"),
    [
        *LOOPS,
        (FOPDT(K=2, tau=120, theta=30), PID(Kc=50, Ti=1)),
        (FOPDT(K=0.5, tau=1, theta=0), PID(Kc=1)),
        (FOPDT(K=1, tau=1e6, theta=1e-3), PID(Kc=0.1, Ti=10)),
        (TransferFunction((0.5,), (1,)), PID(Kc=1)),
    ],
)
def test_the_grid_shows_the_crossovers_with_room_on_both_sides(
    process: Process, controller: PID
) -> None:
    w = frequency_grid(process, controller, 300)
    assert np.all(np.diff(w) > 0)
    assert 300 <= w.size <= 310
    L = np.abs(loop_response(process, controller, w))
    at_one = w[np.abs(L - 1) < 1e-9]
    if at_one.size:
        assert w[0] <= at_one[0] / 9
        assert w[-1] >= at_one[-1] * 9


def test_the_grid_finds_the_peak_of_an_ordinary_loop() -> None:
    process, controller = LOOPS[0]
    w = frequency_grid(process, controller)
    peak = np.max(np.abs(sensitivity(process, controller, w)))
    assert peak == pytest.approx(margins(process, controller).Ms, rel=1e-3)


def test_a_grid_of_one_point_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match="at least 2 points, got 1"):
        frequency_grid(*LOOPS[0], points=1)
