"""Walks around the PID: smooth settings, details, interaction, poles; each by a second route."""

import math

import numpy as np
import pytest

from advice.cascade import cascade_case, cascade_sentences
from advice.conditioning import Wanted, conditioning, measured_noise
from advice.conditioning_body import conditioning_sentences
from advice.horizon import horizon
from advice.interaction import interaction_case, interaction_sentences
from advice.pole_region import Specification, region_case, region_sentences
from advice.schedule import schedule_for
from advice.smooth import smooth_case, smooth_sentences
from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT, DoubleIntegrator
from loop.record import Record
from loop.simulation import simulate
from tuning.conditioning import folded_frequency, longest_scan_time
from tuning.gain_schedule import gain_schedule

HEATER = FOPDT(K=2, tau=120, theta=30)


@pytest.mark.parametrize("theta", [0.0, 3.0])
def test_a_tank_moves_as_far_as_it_may_and_no_further(theta: float) -> None:
    case = smooth_case(IPDT(K=0.01, theta=theta), load=10.0, allowed=20.0)
    smooth, averaging = case.choices
    assert averaging.peak is not None
    assert averaging.peak == pytest.approx(20.0, rel=0.01)
    assert smooth.peak is not None
    assert smooth.peak < 20
    assert averaging.found is not None
    run = simulate(case.process, averaging.found.pid, t_end=8000, dt=0.5, load=10.0)
    assert float(np.max(np.abs(run.pv))) == pytest.approx(averaging.peak, rel=0.01)


def test_a_way_that_is_closed_is_said_beside_the_open_one() -> None:
    short = smooth_case(IPDT(K=0.01, theta=60.0), load=10.0, allowed=12.5)
    smooth, averaging = short.choices
    assert averaging.found is None
    assert "3 dead times" in averaging.refusal
    assert smooth.found is not None
    assert any("Averaging level: Averaging level tuning" in x for x in smooth_sentences(short))
    with pytest.raises(RuleNotApplicable, match=r"needs a deviation of 12 .*; .* 3 dead times"):
        smooth_case(IPDT(K=0.01, theta=60.0), load=10.0, allowed=11.0)
    idle = smooth_case(HEATER, load=5.0, allowed=20.0)
    assert smooth_sentences(idle)[0] == (
        "Without control that load moves PV by 10.0, within what is allowed."
    )


def test_a_loop_around_an_integrator_is_watched_until_it_rests_and_not_for_weeks() -> None:
    for pid in (PID(Kc=0.37, Ti=1074), PID(Kc=16.7, Ti=24), PID(Kc=16.7)):
        t_end, dt = horizon(IPDT(K=0.01, theta=3.0), [pid])
        run = simulate(IPDT(K=0.01, theta=3.0), pid, t_end=t_end, dt=dt, sp=1.0)
        settled = np.abs(run.pv - 1.0) < 0.05
        assert settled[-1]
        assert t_end < 40 * np.max(run.t[~settled])
    assert horizon(DoubleIntegrator(K=0.1, theta=1.0), [PID(Kc=1.2, Ti=16, Td=8)])[0] < 1000


def test_details_without_a_scan_time_rest_on_the_longest() -> None:
    pid = PID(Kc=0.9, Ti=135, Td=13.3)
    found = conditioning(HEATER, pid, Wanted(swing=3.0))
    assert found.scan_time == found.longest == longest_scan_time(HEATER, pid)
    assert found.scan is not None
    assert found.scan.phase_cost == pytest.approx(5.0)
    assert found.longest is not None
    assert found.folded == folded_frequency(3.0, found.longest)
    assert (found.pv_filter, found.ratios) == (None, ())
    assert found.Tt == pytest.approx(math.sqrt(135 * 13.3))
    late = conditioning(HEATER, pid, Wanted(computation=40.0))
    assert (late.longest, late.scan_time, late.anti_alias, late.folded) == (None, None, None, None)
    assert "No scan time is short enough: the computation of 40 s alone costs" in late.notes[0]
    only = conditioning(HEATER, PID(Kc=0.9), Wanted(noise=0.1))
    assert (only.weight, only.Tt, only.ratios) == (None, None, ())


def test_details_that_lose_the_loop_are_notes() -> None:
    pid = PID(Kc=2.4, Ti=80)
    slow = conditioning(HEATER, pid, Wanted(scan_time=60.0, noise=0.1))
    assert slow.scan is None
    assert "Scanned every 60 s the loop is unstable." in slow.notes
    assert slow.pv_filter is None
    lost = conditioning(HEATER, pid, Wanted(scan_time=1.0, noise=0.1, phase_cost=60.0))
    assert any("costs 60° loses the loop" in note for note in lost.notes)
    sharp = PID(Kc=3.0, Ti=200, Td=15, N=20)
    ratios = conditioning(HEATER, sharp, Wanted(scan_time=0.1, noise=0.1))
    assert ratios.ratios == ()
    assert any("N from 2 to 20 the loop is unstable" in note for note in ratios.notes)
    for wrong in ({"phase_cost": 0.0}, {"computation": -1.0}, {"overshoot": -1.0}):
        with pytest.raises(ValueError, match="must"):
            conditioning(HEATER, pid, Wanted(**wrong))
    for impossible in ({"scan_time": 0.0}, {"noise": math.inf}, {"swing": -1.0}):
        with pytest.raises(ValueError, match="must be positive"):
            Wanted(**impossible)


def test_a_filter_that_is_not_enough_or_not_needed_is_said() -> None:
    pid = PID(Kc=0.9, Ti=135, Td=13.3)
    hopeless = conditioning(HEATER, pid, Wanted(scan_time=2.0, noise=1.0, travel=1.0))
    assert any("not enough for 1 OP a day" in x for x in conditioning_sentences(hopeless))
    calm = conditioning(HEATER, pid, Wanted(scan_time=2.0, noise=1e-4, travel=1e3))
    assert "No filter on PV is needed for that travel." in conditioning_sentences(calm)
    tight = conditioning(HEATER, PID(Kc=2.2, Ti=70), Wanted(scan_time=2.0, overshoot=0.0))
    assert any("more than the 0 % allowed" in x for x in conditioning_sentences(tight))


def test_a_coarse_sensor_has_the_noise_of_its_rounding() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(2000.0)
    smooth = 150 + 3 * np.sin(t / 200)
    record = Record(t=t, pv=np.round(smooth / 0.5) * 0.5, op=np.full(t.size, 40.0))
    found = measured_noise(record)
    assert found.resolution == pytest.approx(0.5)
    assert found.sd == pytest.approx(0.5 / math.sqrt(12))
    fine = Record(t=t, pv=smooth + rng.normal(0, 0.2, t.size), op=np.full(t.size, 40.0))
    assert measured_noise(fine).sd == pytest.approx(0.2, rel=0.06)
    assert measured_noise(fine).resolution is None


def test_the_pairing_is_the_one_with_the_gains_nearest_to_one() -> None:
    mixed = interaction_case([[0.1, 2.0], [3.0, 0.2]])
    assert mixed.pairing == (1, 0)
    assert not mixed.interacts
    # By hand: lambda = k11 k22/(k11 k22 - k12 k21) = .02/(.02 - 6).
    assert mixed.relative[0, 0] == pytest.approx(0.02 / (0.02 - 6))
    assert (
        "PV 1 with OP 2 (1.00), PV 2 with OP 1 (1.00). Single loops will do."
        in (interaction_sentences(mixed)[-1])
    )
    column = interaction_case([[12.8, -18.9], [6.6, -19.4]])
    assert column.relative[0, 0] == pytest.approx(2.01, abs=0.005)
    assert column.interacts
    none = interaction_case([[1, 1, -1], [1, -1, 1.2], [-1, 1.1, 1]])
    for row in none.relative:
        assert row.sum() == pytest.approx(1.0)
    bad = np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 3.0], [1.0, -1.0, 2.9]])
    turned = interaction_case(bad.tolist())
    if not turned.pairing:
        assert "must not be used" in interaction_sentences(turned)[-1]


def test_a_region_holds_the_poles_that_answer_as_wanted() -> None:
    case = region_case(Specification(overshoot=0.1, settling=5.0), [-1 - 1j, -0.3 + 2j, -0.4 + 0j])
    good, ringing, slow = case.poles
    assert (good.holds, ringing.holds, slow.holds) == (True, False, False)
    assert good.pole == -1 + 1j
    # Second route: the step response of the pair itself.
    t = np.linspace(0, 40, 40_001)
    y = 1 - np.exp(-t) * (np.cos(t) + np.sin(t))
    assert good.response.overshoot == pytest.approx(float(y.max()) - 1, rel=1e-6)
    assert good.response.settling == pytest.approx(float(t[np.abs(y - 1) > 0.02][-1]), abs=2e-3)
    assert "-0.4, twice, rad/s does not meet it" in region_sentences(case)[-1]
    damped = region_case(Specification(phase=80.0))
    assert damped.region.zeta_min > 1
    assert len(region_sentences(damped)) == 1
    with pytest.raises(ValueError, match="state an overshoot"):
        Specification()


def test_a_schedule_takes_any_rule_and_its_speed() -> None:
    points = [(20.0, FOPDT(K=1, tau=10, theta=2)), (80.0, FOPDT(K=1.2, tau=8, theta=2))]
    assert schedule_for(points) == gain_schedule(points)
    amigo = schedule_for(points, rule="amigo", structure="PID")
    assert all(point.pid.Td > 0 for point in amigo.points)
    with pytest.raises(ValueError, match="amigo has no tau_c"):
        schedule_for(points, rule="amigo", tau_c=3.0)


def test_a_cascade_too_wide_to_simulate_is_tuned_all_the_same() -> None:
    inner = FOPDT(K=1, tau=1e-2, theta=1e-3)
    case = cascade_case(inner, FOPDT(K=1, tau=1e5, theta=1e4), inner_tau_c=1e-3, outer_tau_c=2e4)
    assert case.load is None
    assert len(cascade_sentences(case)) == 5
