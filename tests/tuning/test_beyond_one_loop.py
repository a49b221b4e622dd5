"""Cascade, feed-forward and gain schedule."""

import math
from dataclasses import replace

import numpy as np
import pytest

from loop.controller import PID
from loop.errors import RuleNotApplicable, UnstableLoop
from loop.margins import margins
from loop.open_loop import process_output, step_response
from loop.process import FOPDT, TransferFunction
from tuning.cascade import cascade, sweep_cascade
from tuning.feed_forward import _Law, feed_forward
from tuning.gain_schedule import gain_schedule
from tuning.profiles import PROFILES, Profile
from tuning.response_sweep import judge_sweep
from tuning.robust_cascade import robust_cascade

FLOW, HEAT = FOPDT(K=3, tau=5, theta=1), FOPDT(K=0.8, tau=100, theta=10)
HEATER = FOPDT(K=2, tau=120, theta=30)


def test_the_outer_loop_is_tuned_on_what_the_inner_one_makes_of_its_process() -> None:
    found = cascade(FLOW, HEAT)

    assert found.inner.Kc == pytest.approx(5 / (3 * 2))
    assert (found.seen.tau, found.seen.theta) == pytest.approx((100.5, 11.5))
    assert found.outer.Kc == pytest.approx(100.5 / (0.8 * 23))
    assert found.inner_margins == margins(FLOW, found.inner)
    # The model that the outer loop was tuned on stands for the true one to a few per cent.
    on_model = margins(found.seen, found.outer)
    assert found.outer_margins.Ms == pytest.approx(on_model.Ms, rel=0.05)
    w1 = 0.5 / found.speed_ratio  # SIMC crosses over at 1/(2 theta)
    T2 = 1 / (1 + 2 * 1j * w1 * np.exp(1j * w1))
    gain = found.outer.Kc * 0.8 * (1 + 1 / (92j * w1)) / (100j * w1 + 1)
    assert abs(gain * T2) == pytest.approx(1.0, rel=1e-9)
    assert found.fast_enough
    assert "11.4 times as fast as the outer: fast enough" in found.sentence


def test_an_infinitely_fast_inner_loop_leaves_the_outer_process_alone() -> None:
    inner = FOPDT(K=1, tau=1e-3, theta=1e-3)
    found = cascade(inner, HEAT, outer_tau_c=20.0)
    alone = margins(HEAT, found.outer)

    for name in ("gain", "phase", "delay", "Ms", "Mt"):
        kept = getattr(found.outer_margins, name)
        assert kept == pytest.approx(getattr(alone, name), rel=2e-3), name


def test_a_cascade_whose_inner_loop_is_slow_is_told_so() -> None:
    slow = cascade(FLOW, HEAT, inner_tau_c=4.0, outer_tau_c=8.0)
    assert not slow.fast_enough
    assert "just enough; 10 times would be good" in slow.sentence
    with pytest.raises(RuleNotApplicable, match=r"only 1\.94 times as fast as the outer"):
        cascade(FOPDT(K=3, tau=5, theta=5), FOPDT(K=0.8, tau=10, theta=1), outer_tau_c=12)
    with pytest.raises(RuleNotApplicable):
        cascade(FOPDT(K=3, tau=5, theta=0), HEAT)


def test_the_sweep_of_a_cascade_is_its_margins_on_the_moved_processes() -> None:
    found = cascade(FLOW, HEAT)
    sweep = sweep_cascade(found, FLOW, HEAT, factors=(0.5, 1.0, 1.5))

    assert set(sweep.parameters) == {
        f"{place} {name}" for place in ("inner", "outer") for name in ("K", "tau", "theta")
    }
    assert all(row[1] == found.outer_margins == sweep.nominal for row in sweep.swept.values())
    # Second route: |1 + L| on a fine grid.
    w = np.geomspace(1e-4, 1, 40_001)
    s = 1j * w

    def loop(C: PID, G: FOPDT, factor: float = 1.0) -> np.ndarray:
        lag = factor * G.tau
        law = C.Kc * (1 + 1 / (C.Ti * s))
        return np.asarray(law * G.K * np.exp(-G.theta * s) / (lag * s + 1))

    inner = loop(found.inner, FLOW)
    L = loop(found.outer, HEAT, 0.5) * inner / (1 + inner)
    Ms = sweep.swept["outer tau"][0].Ms
    assert Ms == pytest.approx(float(np.max(1 / np.abs(1 + L))), rel=1e-6)
    assert (sweep.worst_Ms, sweep.worst) == (Ms, "outer tau x 0.5")
    # SIMC at its fastest does not keep the profile where the model is off.
    assert (
        "below 1.995 (6.0 dB) with outer K x 1.5"
        in judge_sweep(sweep, PROFILES["general"]).sentence
    )


def test_an_inner_loop_that_is_lost_takes_the_outer_with_it() -> None:
    tight = cascade(FLOW, HEAT, inner_tau_c=0.02, outer_tau_c=11.5)
    sweep = sweep_cascade(tight, FLOW, HEAT, factors=(1.0, 2.0))
    assert sweep.swept["inner K"][-1].Ms == math.inf
    with pytest.raises(UnstableLoop):
        margins(FOPDT(K=6, tau=5, theta=1), tight.inner)


def test_the_fastest_cascade_keeps_the_profile_and_a_faster_one_does_not() -> None:
    found = robust_cascade(FLOW, HEAT, PROFILES["general"])
    assert found.verdict.passes
    assert found.inner_tau_c == pytest.approx(1.5, abs=0.05)  # SIMC's smallest at theta/tau .2
    worst = [kept for row in found.sweep.swept.values() for kept in row]
    assert max(kept.Ms for kept in worst) == pytest.approx(2.0, abs=0.02)
    quick = cascade(FLOW, HEAT, inner_tau_c=found.inner_tau_c, outer_tau_c=0.97 * found.outer_tau_c)
    sweep = sweep_cascade(quick, FLOW, HEAT, factors=(0.5, 1.5))
    assert not judge_sweep(sweep, PROFILES["general"]).passes
    strict = Profile(name="strict", gain=200.0, phase=45, Ms=2)
    with pytest.raises(
        RuleNotApplicable, match=r"keeps the profile strict under .* there the gain margin is"
    ):
        robust_cascade(FLOW, HEAT, strict, inner_tau_c=1.0)


def test_feed_forward_with_time_to_spare_cancels_the_load() -> None:
    found = feed_forward(HEATER, FOPDT(K=-1, tau=60, theta=40))

    assert (found.gain, found.T_lead, found.T_lag, found.delay) == (0.5, 120, 60, 10)
    assert found.realisable
    assert found.peak < 1e-12
    assert found.peak_without == pytest.approx(1.0, abs=1e-5)
    assert 0 < found.peak_static < found.peak_without
    assert "cancels the load completely" in found.sentence


def test_feed_forward_that_comes_too_late_leaves_what_the_load_does_until_then() -> None:
    found = feed_forward(HEATER, FOPDT(K=-1, tau=60, theta=10))

    assert (found.late, found.delay, found.realisable) == (20, 0.0, False)
    # Until the correction arrives the load moves PV by 1 - e^(-late/tau_d); after, it only fades.
    assert found.peak == pytest.approx(1 - math.exp(-20 / 60), rel=1e-9)
    assert "it comes 20 s too late" in found.sentence


def test_feed_forward_on_a_model_that_is_off_leaves_what_a_simulation_shows() -> None:
    load = FOPDT(K=-1, tau=60, theta=40)
    found = feed_forward(HEATER, load)
    # With half the load's gain it does as much harm as it does good.
    assert found.worst_part == pytest.approx(1.0, rel=1e-3)
    assert found.worst == "K of the load x 0.5"
    # A load that is twice as wide and comes early: the worst is another one.
    quick = feed_forward(FOPDT(K=2, tau=10, theta=30), FOPDT(K=-1, tau=60, theta=31))
    name, _, rest = quick.worst.partition(" of the ")
    place, _, factor = rest.partition(" x ")
    moved = {"process": FOPDT(K=2, tau=10, theta=30), "load": FOPDT(K=-1, tau=60, theta=31)}
    moved[place] = replace(moved[place], **{name: getattr(moved[place], name) * float(factor)})
    t = np.arange(0, 500, 0.02)
    later = np.maximum(t - quick.delay, 0.0)
    op = quick.gain * (1 + (quick.T_lead / quick.T_lag - 1) * np.exp(-later / quick.T_lag))
    op = np.where(t >= quick.delay, op, 0.0)
    alone = process_output(moved["load"], t, np.ones_like(t), op_before=0.0)
    y = alone + process_output(moved["process"], t, op, op_before=0.0)
    part = np.max(np.abs(y)) / np.max(np.abs(alone))
    assert part == pytest.approx(quick.worst_part, abs=5e-3)


@pytest.mark.parametrize("lag", [120.0, 60.0])
def test_a_lead_on_a_wrong_lag_is_followed_in_time(lag: float) -> None:
    law = _Law(gain=0.5, lead=100.0, lag=lag, delay=5.0)
    t = np.linspace(0, 900, 301)
    path = TransferFunction((100.0, 1.0), tuple(np.polymul((lag, 1.0), (120.0, 1.0))), 35.0)
    np.testing.assert_allclose(law.answer(HEATER, t), step_response(path, t), atol=1e-9)


def test_a_lead_that_would_only_multiply_noise_is_held() -> None:
    load = FOPDT(K=-1, tau=6, theta=40)
    found = feed_forward(HEATER, load)
    assert (found.T_lag, found.realisable) == (12.0, False)
    assert "its lead is held to 10 times its lag" in found.sentence
    # The same by driving the process with the feed-forward's own output, held by small steps.
    t = np.arange(0, 400, 0.02)
    ff = np.where(t >= 10, 0.5 * (1 + (120 / 12 - 1) * np.exp(-(t - 10) / 12)), 0.0)
    y = process_output(load, t, np.ones_like(t), op_before=0.0)
    y = y + process_output(HEATER, t, ff, op_before=0.0)
    assert np.max(np.abs(y)) == pytest.approx(found.peak, abs=2e-3)
    with pytest.raises(ValueError, match="largest_ratio must be 1 or more, got 0"):
        feed_forward(HEATER, load, largest_ratio=0.0)


def test_a_schedule_says_where_its_points_are_too_far_apart() -> None:
    processes = [
        (90.0, FOPDT(K=6, tau=5, theta=2)),
        (10.0, FOPDT(K=1, tau=10, theta=2)),
        (50.0, FOPDT(K=1.3, tau=9, theta=2)),
    ]
    found = gain_schedule(processes)

    assert [point.at for point in found.points] == [10.0, 50.0, 90.0]
    near, far = found.gaps
    assert near.steps
    assert near.lines
    assert far.held_Ms == math.inf
    assert not far.steps
    assert "between 50 to 90, Ms inf" in found.sentence
    # Second route: the swapped settings, one by one.
    low, high = found.points[0], found.points[1]
    swapped = max(margins(low.process, high.pid).Ms, margins(high.process, low.pid).Ms)
    assert near.held_Ms == swapped
    close = gain_schedule(processes[1:], profile="servo")
    assert close.sentence == "The profile servo holds at every point and over every step between."


def test_a_rule_of_ones_own_may_fail_between_the_points_or_at_one() -> None:
    processes = [(0.0, FOPDT(K=1, tau=10, theta=2)), (1.0, FOPDT(K=8, tau=10, theta=2))]
    # Half way the mean gain meets the mean setting, which is far above its own.
    found = gain_schedule(processes, rule=lambda p: PID(Kc=1.5 * p.tau / (p.K * 4), Ti=p.tau))
    assert not found.gaps[0].lines
    assert "add points" in found.sentence
    with pytest.raises(UnstableLoop):
        gain_schedule(processes, rule=lambda _: PID(Kc=5, Ti=10))


def test_schedules_that_cannot_be_are_refused() -> None:
    one = FOPDT(K=1, tau=10, theta=2)
    for points in ([(1.0, one)], [(1.0, one), (1.0, one)], [(1.0, one), (math.nan, one)]):
        with pytest.raises(ValueError, match="two or more different operating points"):
            gain_schedule(points)
    with pytest.raises(ValueError, match="the process gain changes its sign"):
        gain_schedule([(1.0, one), (2.0, FOPDT(K=-1, tau=10, theta=2))])
