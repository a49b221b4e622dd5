"""Noise, filters, scan time and weights: computed, and found again by simulation."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, freqs

from advice.conditioning import Wanted, conditioning
from loop.controller import PID, Action
from loop.errors import UnstableLoop
from loop.margins import margins
from loop.process import FOPDT, IPDT, SOPDT, TransferFunction
from loop.response import loop_response
from loop.simulation import simulate
from loop.simulation_batch import simulate_batch
from tuning.conditioning import (
    anti_alias,
    choose_pv_filter,
    crossover,
    folded_frequency,
    longest_scan_time,
    scan_cost,
)
from tuning.filtered_loop import with_pv_filter
from tuning.loop_details import choose_set_point_weight, filter_ratios
from tuning.output_movement import output_movement

HEATER = FOPDT(K=2, tau=120, theta=30)
PI, FAST = PID(Kc=0.9, Ti=120), PID(Kc=0.9, Ti=135, Td=13.3)


@pytest.mark.parametrize(
    ("process", "pid", "scan_time", "pv_filter"),
    [
        (HEATER, PI, 2.0, 0.0),
        (HEATER, FAST, 3.7, 0.0),
        (HEATER, replace(FAST, tauF=12.0), 2.0, 0.0),
        (SOPDT(K=-1, tau1=40, tau2=9, theta=0), PID(Kc=2, Ti=40, action=Action.DIRECT), 2.0, 8.0),
        (IPDT(K=0.02, theta=5), PID(Kc=3, Ti=80, Td=2), 1.0, 4.0),
        (TransferFunction((2.0,), (60.0, 30.0, 2.0), 1.3), PID(Kc=0.8, Ti=12), 1.0, 0.0),
    ],
)
def test_the_noise_moves_the_output_as_in_a_simulation(
    process: FOPDT | SOPDT | IPDT | TransferFunction, pid: PID, scan_time: float, pv_filter: float
) -> None:
    """300 loops of 700 scans; half of it counts. The spread of the estimate is below 1 %."""
    found = output_movement(process, pid, scan_time=scan_time, noise=0.3, pv_filter=pv_filter)
    run = simulate_batch(
        [process],
        [pid] * 300,
        t_end=700 * scan_time,
        dt=scan_time,
        noise=0.3,
        rng=np.random.default_rng(2),
        pv_filter=pv_filter,
    )
    op = run.op[350:]
    moves = np.diff(op, axis=0)
    assert found.sd == pytest.approx(op.std(), rel=0.04)
    assert found.move == pytest.approx(np.abs(moves).mean(), rel=0.02)
    assert found.travel == pytest.approx(np.abs(moves).mean() * 86_400 / scan_time, rel=0.02)
    turned = np.mean(np.sign(moves[1:]) != np.sign(moves[:-1]))
    assert found.reversals * scan_time / 86_400 == pytest.approx(turned, rel=0.02)


def test_proportional_control_without_a_process_answer_is_its_gain() -> None:
    """By hand: u = -Kc n, so sd = Kc s, E|du| = 2 Kc s/sqrt(pi); r = -1/2, so 2/3 of them turn."""
    deaf = FOPDT(K=1e-9, tau=100, theta=10)
    found = output_movement(deaf, PID(Kc=3), scan_time=2, noise=0.5)
    assert found.sd == pytest.approx(1.5, rel=1e-6)
    assert found.move == pytest.approx(2 * 1.5 / math.sqrt(math.pi), rel=1e-6)
    assert found.reversals == pytest.approx(86_400 / 2 * 2 / 3, rel=1e-6)
    silent = output_movement(deaf, PID(Kc=3), scan_time=2, noise=0)
    assert (silent.sd, silent.travel) == (0, 0)


def test_an_unstable_loop_has_no_spread() -> None:
    with pytest.raises(UnstableLoop):
        output_movement(HEATER, PID(Kc=5, Ti=50), scan_time=1, noise=0.1)
    with pytest.raises(ValueError, match="scan_time must be positive"):
        output_movement(HEATER, PI, scan_time=0, noise=0.1)
    with pytest.raises(ValueError, match="noise and pv_filter must not be negative"):
        output_movement(HEATER, PI, scan_time=1, noise=-1)


@pytest.mark.parametrize("pid", [PI, replace(PI, tauF=7.0)])
def test_a_filter_of_pv_stands_in_the_loop_once(pid: PID) -> None:
    w = np.geomspace(1e-4, 1, 30)
    expected = loop_response(HEATER, pid, w) / (1 + 1j * w * 5)
    np.testing.assert_allclose(loop_response(*with_pv_filter(HEATER, pid, 5.0), w), expected)
    assert with_pv_filter(HEATER, pid, 0.0) == (HEATER, pid)


@pytest.mark.parametrize(("part", "degrees"), [(0.05, 1.4), (0.314, 9.0)])
def test_a_scan_costs_what_the_anchor_says(part: float, degrees: float) -> None:
    wc = crossover(HEATER, PI)
    cost = scan_cost(HEATER, PI, scan_time=part / wc)
    assert cost.wc == wc
    assert cost.phase_cost == pytest.approx(degrees, abs=0.05)
    lost = cost.continuous.phase - cost.scanned.phase
    assert lost == pytest.approx(cost.phase_cost, abs=1e-6)


def test_the_longest_scan_costs_what_is_allowed() -> None:
    h = longest_scan_time(HEATER, FAST, phase_cost=8.0, computation=3.0)
    cost = scan_cost(HEATER, FAST, scan_time=h, computation=3.0)
    assert cost.phase_cost == pytest.approx(8)
    assert cost.continuous.phase - cost.scanned.phase == pytest.approx(8, abs=1e-6)
    assert cost.scans_a_filter == pytest.approx(1.33 / h)
    assert scan_cost(HEATER, PI, scan_time=h).scans_a_filter == math.inf
    with pytest.raises(ValueError, match="computation of 50 s alone costs"):
        longest_scan_time(HEATER, FAST, computation=50.0)
    with pytest.raises(ValueError, match="phase_cost must lie between"):
        longest_scan_time(HEATER, FAST, phase_cost=0)
    with pytest.raises(ValueError, match="must not be negative"):
        scan_cost(HEATER, FAST, scan_time=-1)
    with pytest.raises(ValueError, match="nowhere 1"):
        scan_cost(HEATER, PID(Kc=0.1), scan_time=1)


def test_the_filter_is_the_fastest_that_keeps_the_travel() -> None:
    """Its travel is found again by simulation, and one a tenth faster is not enough."""
    bare = output_movement(HEATER, FAST, scan_time=2, noise=0.1)
    wanted = 0.75 * bare.travel
    chosen = choose_pv_filter(HEATER, FAST, scan_time=2, noise=0.1, travel=wanted)
    assert chosen.enough
    assert chosen.before == bare
    assert 0.97 * wanted < chosen.after.travel <= wanted
    faster = output_movement(HEATER, FAST, scan_time=2, noise=0.1, pv_filter=0.9 * chosen.time)
    assert faster.travel > wanted
    run = simulate(
        HEATER,
        FAST,
        t_end=40_000,
        dt=2,
        noise=0.1,
        rng=np.random.default_rng(9),
        pv_filter=chosen.time,
    )
    assert np.abs(np.diff(run.op)).sum() * 86_400 / 40_000 == pytest.approx(wanted, rel=0.04)
    assert chosen.phase_cost < 5
    assert chosen.within.phase < chosen.without.phase
    assert chosen.within == margins(*with_pv_filter(HEATER, FAST, chosen.time), sample_time=2)


def test_a_filter_that_is_not_needed_or_not_enough_says_so() -> None:
    free = choose_pv_filter(HEATER, PI, scan_time=2, noise=0.001, travel=1e6)
    assert (free.time, free.enough, free.phase_cost) == (0, True, 0)
    hopeless = choose_pv_filter(HEATER, FAST, scan_time=2, noise=1.0, travel=1.0, phase_cost=3)
    assert not hopeless.enough
    assert hopeless.phase_cost == pytest.approx(3)
    assert hopeless.after.travel < hopeless.before.travel
    with pytest.raises(ValueError, match="travel must be positive"):
        choose_pv_filter(HEATER, PI, scan_time=2, noise=0.1, travel=0)
    with pytest.raises(ValueError, match="phase_cost must lie"):
        choose_pv_filter(HEATER, PI, scan_time=2, noise=0.1, travel=1, phase_cost=90)


@pytest.mark.parametrize("order", [1, 2])
def test_an_anti_alias_filter_is_the_one_of_scipy(order: int) -> None:
    filtered = anti_alias(HEATER, PI, scan_time=10, attenuation=0.2, order=order)
    wc = crossover(HEATER, PI)
    b, a = butter(order, filtered.w0, analog=True)
    _, at = freqs(b, a, worN=np.array([wc, math.pi / 10]))
    assert abs(at[1]) == pytest.approx(0.2)
    assert -math.degrees(np.angle(at[0])) == pytest.approx(filtered.phase_cost)


def test_impossible_anti_alias_filters_are_refused() -> None:
    for wrong in ({"scan_time": 0.0}, {"scan_time": 1.0, "attenuation": 1.0}):
        with pytest.raises(ValueError, match="must"):
            anti_alias(HEATER, PI, **wrong)
    with pytest.raises(ValueError, match="order be 1 or 2"):
        anti_alias(HEATER, PI, scan_time=1, order=3)


@pytest.mark.parametrize("period", [2.3, 3.1, 0.7, 9.0])
def test_a_fast_swing_appears_where_the_samples_show_it(period: float) -> None:
    k = np.arange(4000)
    wave = np.sin(2 * np.pi * k / period)  # sampled once a second
    seen = np.fft.rfftfreq(k.size)[np.argmax(np.abs(np.fft.rfft(wave)))]
    assert folded_frequency(2 * np.pi / period, 1.0) == pytest.approx(2 * np.pi * seen, abs=0.002)


def test_the_set_point_weight_is_the_largest_that_keeps_the_overshoot() -> None:
    tight = PID(Kc=1.8, Ti=60)
    chosen = choose_set_point_weight(HEATER, tight, most_overshoot=20, scan_time=2, t_end=900)
    assert 0 < chosen.b < 1
    assert chosen.enough

    def overshoot(b: float) -> float:
        run = simulate(HEATER, replace(tight, b=b), t_end=900, dt=2, sp=1.0)
        return 100 * (float(run.pv.max()) - 1)

    assert chosen.overshoot == pytest.approx(overshoot(chosen.b))
    assert overshoot(chosen.b) <= 20 < overshoot(chosen.b + 0.05)
    never = choose_set_point_weight(HEATER, tight, most_overshoot=0, scan_time=2, t_end=900)
    assert (never.b, never.enough) == (0, False)
    calm = choose_set_point_weight(HEATER, PID(Kc=0.4, Ti=120), scan_time=2, t_end=900)
    assert (calm.b, calm.overshoot) == (1, 0)
    with pytest.raises(ValueError, match="most_overshoot must not be negative"):
        choose_set_point_weight(HEATER, tight, most_overshoot=-1, scan_time=2, t_end=900)
    with pytest.raises(ValueError, match="no weight helps"):
        choose_set_point_weight(HEATER, PID(Kc=9, Ti=9), scan_time=20, t_end=50_000)


def test_a_larger_filter_ratio_keeps_more_and_moves_more() -> None:
    rows = filter_ratios(HEATER, FAST, scan_time=2, noise=0.1)
    travels = [row.movement.travel for row in rows]
    assert travels == sorted(travels)
    peaks = [row.margins.Ms for row in rows]
    assert peaks == sorted(peaks, reverse=True)
    ten = next(row for row in rows if row.N == 10)
    assert ten.margins == margins(HEATER, FAST, sample_time=2)
    assert ten.movement == output_movement(HEATER, FAST, scan_time=2, noise=0.1)
    with pytest.raises(ValueError, match="no filter ratio"):
        filter_ratios(HEATER, PI, scan_time=2, noise=0.1)


def test_a_loop_too_slow_to_be_summed_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tuning.output_movement.MOST", 2**12)
    endless = SOPDT(K=-1, tau1=1e9, tau2=1e-9, theta=72.7)
    pid = PID(Kc=2034.0, Td=10.0, tauF=10.0, action=Action.DIRECT)
    with pytest.raises(ValueError, match=r"too slow for its output movement .* longer scan time"):
        output_movement(endless, pid, scan_time=1e-9, noise=0.5)
    found = conditioning(endless, pid, Wanted(scan_time=1e-9, noise=0.5))
    assert found.pv_filter is None
    assert any("No movement of the output was found" in note for note in found.notes)
