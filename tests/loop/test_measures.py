"""Response measures against closed forms, printed anchors and quadrature."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loop.controller import PID
from loop.measures import (
    error_integrals,
    first_crossing,
    load_measures,
    settling_time,
    step_measures,
    total_variation,
)
from loop.open_loop import step_response
from loop.process import FOPDT, IPDT, TransferFunction
from loop.signals import Real
from loop.simulation import simulate

T = np.arange(0, 60, 0.002)


def second_order(zeta: float) -> Real:
    return step_response(TransferFunction((1.0,), (1.0, 2 * zeta, 1.0)), T)


@pytest.mark.parametrize(("zeta", "rise"), [(0.3, 1.321), (0.5, 1.638), (0.7, 2.126), (1.0, 3.358)])
def test_the_rise_time_of_a_second_order_answer_is_the_printed_one(
    zeta: float, rise: float
) -> None:
    found = step_measures(T, second_order(zeta), np.zeros(T.size), sp=1, pv0=0)
    assert found.rise_time == pytest.approx(rise, abs=5e-4)


@pytest.mark.parametrize(("zeta", "percent"), [(0.420, 23.3), (0.612, 8.8), (0.803, 1.4)])
def test_the_overshoot_of_a_second_order_answer_is_the_printed_one(
    zeta: float, percent: float
) -> None:
    found = step_measures(T, second_order(zeta), np.zeros(T.size), sp=1, pv0=0)
    root = math.sqrt(1 - zeta**2)
    assert found.overshoot == pytest.approx(100 * math.exp(-math.pi * zeta / root), abs=1e-3)
    assert found.overshoot == pytest.approx(percent, abs=0.1)
    assert found.peak_time == pytest.approx(math.pi / root, abs=0.002)
    assert found.peak == pytest.approx(1 + found.overshoot / 100)


@pytest.mark.parametrize("scale", [1.0, -3.0])
def test_a_first_order_answer_is_the_closed_form(scale: float) -> None:
    t = np.linspace(0, 40, 4001)
    pv = 5 + scale * -np.expm1(-t / 2)
    found = step_measures(t + 7, pv, np.exp(-t), sp=5 + scale, pv0=5, op_before=0.0)
    assert found.rise_time == pytest.approx(2 * math.log(9), abs=1e-4)
    assert found.settling_time == pytest.approx(2 * math.log(50), abs=1e-4)
    assert found.overshoot == 0
    assert pytest.approx(2 * abs(scale), rel=1e-5) == found.IAE
    assert pytest.approx(scale**2, rel=1e-5) == found.ISE
    assert pytest.approx(4 * abs(scale), rel=1e-4) == found.ITAE
    assert found.steady_error == pytest.approx(0, abs=1e-6 * abs(scale))
    assert found.total_variation == pytest.approx(2, abs=1e-6)  # up to 1, back to 0


def test_the_motor_settles_when_the_anchor_says() -> None:
    motor = FOPDT(K=100, tau=0.05, theta=0.005)
    loop = simulate(motor, PID(Kc=0.02857, Ti=0.05), t_end=0.2, dt=1e-5, sp=500.0)
    found = step_measures(loop.t, loop.pv, loop.op, sp=500, pv0=0, op_before=0)
    assert found.settling_time == pytest.approx(0.0504, abs=5e-5)
    assert first_crossing(loop.t, loop.pv, 0.95 * 500) == pytest.approx(0.0401, abs=1e-4)


def test_tyreus_luyben_on_an_integrator_overshoots_by_a_quarter() -> None:
    loop = simulate(IPDT(K=1, theta=1), PID(Kc=math.pi / 6.44, Ti=8.8), t_end=80, dt=0.01, sp=1.0)
    found = step_measures(loop.t, loop.pv, loop.op, sp=1, pv0=0)
    assert found.overshoot == pytest.approx(25, abs=0.5)
    assert found.steady_error == pytest.approx(0, abs=1e-3)


def test_the_integral_error_of_a_load_is_ti_over_kc() -> None:
    """An integrating controller ends at op = -load, so int e = Ti load/Kc; no sign change: IAE."""
    heater, pid = FOPDT(K=2, tau=120, theta=30), PID(Kc=0.45, Ti=135, Td=13.3, tauF=12)
    loop = simulate(heater, pid, t_end=3000, dt=0.5, load=10.0)
    found = load_measures(loop.t, loop.pv, loop.op, sp=0.0, op_before=0.0)
    assert pytest.approx(10 * 135 / 0.45, rel=1e-8) == found.IAE
    assert found.peak_deviation >= 4.42
    assert 60 < found.peak_time < 200
    assert found.total_variation == pytest.approx(10, rel=0.05)
    assert found.settling_time is not None
    tail = np.abs(loop.pv[loop.t > found.settling_time])
    assert tail.max() <= 0.02 * found.peak_deviation * (1 + 1e-9)


def test_what_never_arrives_has_no_time() -> None:
    t = np.linspace(0, 10, 101)
    slow = step_measures(t, 0.05 * t, t, sp=1, pv0=0)
    assert (slow.rise_time, slow.settling_time) == (None, None)
    assert slow.steady_error == pytest.approx(1 - 0.05 * 9.75)
    assert slow.peak_time == 10
    never = load_measures(t, -t, t, sp=0)
    assert never.settling_time is None
    assert never.peak_deviation == -10
    nothing = step_measures(t, np.zeros(101), t, sp=1, pv0=0)
    assert (nothing.rise_time, nothing.overshoot) == (None, 0)


def test_a_loop_that_was_not_disturbed_has_settled() -> None:
    t = np.linspace(0, 10, 101)
    still = load_measures(t, np.full(101, 4.0), np.zeros(101), sp=4.0)
    assert (still.settling_time, still.IAE, still.peak_deviation) == (0, 0, 0)


@settings(deadline=None, max_examples=30)
@given(
    t=st.lists(st.floats(0.01, 3), min_size=3, max_size=12),
    seed=st.integers(0, 1000),
)
def test_the_integrals_are_those_of_the_broken_line(t: list[float], seed: int) -> None:
    times = np.cumsum(t)
    e = np.random.default_rng(seed).normal(size=times.size)
    found = error_integrals(times, e)
    dense = np.linspace(times[0], times[-1], 200_001)
    size = np.abs(np.interp(dense, times, e))
    second = [np.trapezoid(f, dense) for f in (size, size**2, dense * size)]
    assert pytest.approx(tuple(second), rel=1e-5) == (found.IAE, found.ISE, found.ITAE)


@given(gain=st.floats(0.01, 100), pace=st.floats(0.01, 100), shift=st.floats(-50, 50))
def test_units_change_only_what_they_must(gain: float, pace: float, shift: float) -> None:
    t = np.arange(0, 20, 0.05)
    pv, op = 1 - np.exp(-t / 3) * np.cos(t), np.exp(-t)
    a = step_measures(t, pv, op, sp=1, pv0=0, op_before=0)
    b = step_measures(pace * t, shift + gain * pv, op, sp=shift + gain, pv0=shift, op_before=0)
    assert b.overshoot == pytest.approx(a.overshoot, rel=1e-6)
    assert a.rise_time is not None
    assert a.settling_time is not None
    assert b.rise_time == pytest.approx(pace * a.rise_time, rel=1e-6)
    assert b.settling_time == pytest.approx(pace * a.settling_time, rel=1e-6)
    assert b.peak_time == pytest.approx(pace * a.peak_time, rel=1e-6)
    assert pytest.approx(gain * pace * a.IAE, rel=1e-6) == b.IAE
    assert pytest.approx(gain**2 * pace * a.ISE, rel=1e-6) == b.ISE
    assert pytest.approx(gain * pace**2 * a.ITAE, rel=1e-6) == b.ITAE
    assert b.total_variation == a.total_variation


def test_an_event_between_two_samples_is_interpolated() -> None:
    t = np.arange(10.0)
    pv = np.maximum(t - 4.5, 0.0)
    found = step_measures(t, pv, np.where(t >= 4, 2.0, 0.0), sp=3, pv0=0, at=4.25)
    assert found.peak_time == 4.75
    assert found.total_variation == 0  # the output had moved by then
    ramp = load_measures(t, t, t, sp=0.0, at=2.5)
    assert pytest.approx((81 - 6.25) / 2) == ramp.IAE


def test_single_measures_answer_at_their_edges() -> None:
    t = np.array([0.0, 1.0, 2.0])
    assert first_crossing(t, np.array([1.0, 2.0, 3.0]), 0.5) == 0
    assert first_crossing(t, np.array([1.0, 2.0, 3.0]), 2.5) == 1.5
    assert first_crossing(t, np.array([1.0, 2.0, 3.0]), 4) is None
    assert settling_time(t, np.array([-1.0, 0.0, 0.0]), 0.25) == 0.75
    assert total_variation(np.array([1.0, 3.0, 2.0]), before=0.0) == 4
    assert total_variation(np.array([1.0, 3.0, 2.0])) == 3


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"t": [], "pv": [], "op": []}, "two after it"),
        ({"t": [0, 1], "pv": [0, 1], "op": [0, 1]}, "two after it"),
        ({"at": -1.0}, "at or before its event at -1"),
        ({"at": 8.5}, "two after it"),
        ({"pv": [math.nan] * 10}, "gaps"),
        ({"pv": [1.0]}, "equally long"),
        ({"t": [0.0] * 10}, "increase strictly"),
        ({"band": 0.0}, "band must lie"),
        ({"sp": math.nan}, "set point must"),
    ],
)
def test_what_cannot_be_measured_is_refused_in_words(
    changed: dict[str, list[float]], words: str
) -> None:
    good = {"t": np.arange(10.0), "pv": np.arange(10.0), "op": np.arange(10.0), "sp": 5.0}
    with pytest.raises(ValueError, match=words):
        load_measures(**{**good, **changed})
    with pytest.raises(ValueError, match=words):
        step_measures(pv0=0, **{**good, **changed})


def test_a_set_point_that_stays_is_no_step() -> None:
    with pytest.raises(ValueError, match="must move, got 3 before and 3"):
        step_measures(T, T, T, sp=3, pv0=3)
