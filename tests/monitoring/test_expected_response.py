"""Recorded set-point moves against what model and settings lead to expect."""

from dataclasses import replace

import numpy as np
import pytest

from loop.controller import PID
from loop.digital_pid import OutputLimits
from loop.disturbances import coloured_noise
from loop.measures import step_measures
from loop.process import FOPDT, IPDT, Process, PureDelay
from loop.process_variation import varied
from loop.simulation import simulate
from monitoring.basis import Confidence
from monitoring.expected_response import (
    Departure,
    ExpectedResponse,
    _overall,
    expected_response,
)
from monitoring.known_loop import KnownLoop
from monitoring.loop_signals import Stretch
from monitoring.set_point_moves import set_point_moves

MODEL = FOPDT(K=2.0, tau=20.0, theta=5.0)
SETTINGS = PID(Kc=0.9, Ti=20.0)
SHEET = KnownLoop(process=MODEL, controller=SETTINGS, limits=OutputLimits(low=0.0, high=100.0))


def recorded(
    process: Process = MODEL,
    pid: PID = SETTINGS,
    *,
    seed: int = 0,
    size: float = 1.0,
    hold: int = 300,
    noise: float = 0.03,
    load: float = 0.05,
    limits: OutputLimits | None = None,
) -> Stretch:
    rng = np.random.default_rng(seed)
    t = np.arange(6.0 * hold)
    sp = 50 + size * ((t // hold) % 2)
    run = simulate(
        process, pid, t_end=t[-1], dt=1.0, sp=sp, pv0=50.0, op0=50.0, noise=noise, rng=rng,
        limits=limits, load=coloured_noise(t, memory=60.0, size=load, rng=rng) if load else 0.0,
    )  # fmt: skip
    return Stretch(first=0, dt=1.0, pv=run.pv, op=run.op, sp=run.sp, share=1.0)


def compared(stretch: Stretch, sheet: KnownLoop = SHEET) -> ExpectedResponse:
    return expected_response(stretch, set_point_moves(stretch), sheet)


def test_without_noise_the_expected_response_is_the_recorded_one() -> None:
    quiet = recorded(noise=0.0, load=0.0)
    found = compared(quiet)
    assert found.as_expected
    assert len(found.moves) == 5
    truth = step_measures(
        np.arange(300.0), quiet.pv[300:600], quiet.op[300:600], sp=51.0, pv0=50.0, band=0.05
    )
    for move in found.moves:
        assert move.rise_time == pytest.approx(move.expected_rise_time, abs=1e-6)
        assert move.rise_time == pytest.approx(truth.rise_time, rel=0.03)
        assert move.overshoot == pytest.approx(move.expected_overshoot, abs=1e-6)
        assert move.settling_time == pytest.approx(move.expected_settling_time, abs=1e-6)
        assert move.IAE_ratio == pytest.approx(1.0, abs=1e-6)
        assert move.gain_ratio == pytest.approx(1.0, abs=1e-3)
        assert move.distance < 1e-6
    assert [move.size for move in found.moves] == [1.0, -1.0, 1.0, -1.0, 1.0]


def test_the_right_sheet_raises_no_alarm_under_noise_and_loads() -> None:
    found = [compared(recorded(seed=seed)) for seed in range(12)]
    assert all(one.as_expected for one in found)
    assert all(one.basis.confidence is Confidence.HIGH for one in found)


@pytest.mark.parametrize(
    ("process", "pid", "kind"),
    [
        (MODEL, PID(Kc=0.35, Ti=20.0), Departure.SLOWER),
        (varied(MODEL, K=0.4), SETTINGS, Departure.SLOWER),
        (varied(MODEL, K=0.5), SETTINGS, Departure.GAIN_OFF),
        (MODEL, PID(Kc=1.9, Ti=20.0), Departure.FASTER),
        (MODEL, PID(Kc=0.9, Ti=7.0), Departure.OSCILLATORY),
        (varied(MODEL, theta=2.4), SETTINGS, Departure.OSCILLATORY),
    ],
)
def test_a_loop_that_is_not_the_sheets_is_told_how_it_differs(
    process: Process, pid: PID, kind: Departure
) -> None:
    for seed in range(3):
        found = compared(recorded(process, pid, seed=seed, hold=600))
        assert found.as_expected is False
        assert kind in found.departures, found.departures


def test_the_gain_is_that_of_the_ends() -> None:
    found = compared(recorded(varied(MODEL, K=0.5), hold=600, load=0.02))
    assert found.gain_ratio == pytest.approx(0.5, rel=0.05)
    integrating = KnownLoop(process=IPDT(K=0.02, theta=5.0), controller=PID(Kc=3.0, Ti=60.0))
    one = compared(recorded(integrating.process, PID(Kc=3.0, Ti=60.0), hold=500), integrating)
    assert one.as_expected
    assert one.gain_ratio is None


def test_an_output_at_its_limit_is_expected_there() -> None:
    limits = OutputLimits(low=49.5, high=50.8)
    slow = recorded(size=1.5, load=0.0, hold=400, limits=limits)
    aware, unaware = (
        compared(slow, replace(SHEET, limits=given)) for given in (limits, OutputLimits())
    )
    assert aware.as_expected
    assert unaware.distance is not None
    assert aware.distance is not None
    assert aware.distance < 0.2 * unaware.distance


def test_the_sheets_scan_time_and_proportional_action_alone_are_taken() -> None:
    pid = PID(Kc=1.2)
    sheet = replace(SHEET, controller=pid, scan_time=0.5, uncertainty=0.0)
    found = compared(recorded(MODEL, pid, load=0.0), sheet)
    # a P controller leaves an offset, and the expectation knows it; none reaches 90 %
    assert found.as_expected
    assert found.moves[0].expected_rise_time is None
    late = KnownLoop(process=PureDelay(K=1.0, theta=8.0), controller=PID(Kc=0.2, Ti=6.0))
    assert compared(recorded(late.process, PID(Kc=0.2, Ti=6.0)), late).as_expected


def test_something_else_is_told_too() -> None:
    # Neither rise nor overshoot is off by a quarter, but no doubt of the model accounts for it.
    sure = replace(SHEET, uncertainty=0.0)
    found = compared(recorded(varied(MODEL, K=0.9), noise=0.001, load=0.0), sure)
    assert found.as_expected is False
    assert Departure.OTHERWISE in found.departures


def test_moves_that_differ_in_different_ways_differ() -> None:
    found = compared(recorded())
    ways = [(Departure.SLOWER,), (Departure.FASTER,), (Departure.OSCILLATORY,), (), ()]
    moves = tuple(
        replace(move, departures=way) for move, way in zip(found.moves, ways, strict=True)
    )
    odd = _overall(moves, 0.2, recorded(), ())
    assert (odd.as_expected, odd.departures) == (False, (Departure.OTHERWISE,))


def test_a_process_without_dead_time_and_a_busy_set_point() -> None:
    prompt = replace(SHEET, process=FOPDT(K=2.0, tau=20.0, theta=0.0))
    assert compared(recorded(prompt.process), prompt).as_expected
    slow = replace(SHEET, controller=PID(Kc=0.05, Ti=20.0))
    busy = compared(recorded(pid=PID(Kc=0.05, Ti=20.0), hold=60), slow)
    assert busy.basis.reasons == ("the set point moves on before responses have settled",)


def test_what_cannot_be_compared_says_why() -> None:
    stretch = recorded()
    hasty = recorded(hold=15)
    drifting = recorded(noise=1.0, load=3.0)
    shaken = replace(stretch, pv=stretch.pv + np.where(np.arange(1800) % 300 > 200, 0.6, 0.0))
    runaway = replace(SHEET, controller=PID(Kc=60.0, Ti=0.01))
    for data, sheet, why in (
        (stretch, replace(SHEET, controller=None), "no settings are known"),
        (replace(stretch, sp=None), SHEET, "left alone"),
        (hasty, SHEET, "left alone"),
        (drifting, SHEET, ""),
        (shaken, SHEET, "no set-point move is clear"),
        (stretch, runaway, "make an unstable loop"),
    ):
        found = compared(data, sheet)
        assert found.basis.refused
        assert why in found.basis.reasons[0], found.basis.reasons
        assert found.as_expected is None


def test_settings_that_settle_beyond_the_record_are_not_compared() -> None:
    asleep = replace(SHEET, controller=PID(Kc=1e-6, Ti=900.0))
    found = compared(recorded(), asleep)
    assert found.basis.reasons == ("the set point moves on before responses have settled",)


def test_one_move_alone_is_a_doubt() -> None:
    whole = recorded()
    assert whole.sp is not None
    one = replace(whole, pv=whole.pv[:600], op=whole.op[:600], sp=whole.sp[:600])
    right, wrong = compared(one), compared(one, replace(SHEET, controller=PID(Kc=3.0, Ti=20.0)))
    assert right.as_expected
    assert right.basis.confidence is wrong.basis.confidence is Confidence.MEDIUM
    assert (wrong.as_expected, wrong.departures) == (None, ())
    assert wrong.moves[0].departures
