from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from loop.record import Mode
from loop.signals import Codes, Real
from monitoring.basis import Confidence, graded
from monitoring.error_statistics import error_statistics
from monitoring.loop_signals import LoopSignals, controlled_stretch, unfit
from monitoring.usage import reversals_of, usage


def hour(
    *,
    mode: Real | Codes | None = None,
    op: Real | None = None,
    pv: Real | None = None,
    sp: Real | None = None,
    pv_range: tuple[float, float] | None = (0.0, 100.0),
) -> LoopSignals:
    n = 360
    return LoopSignals(
        dt=10.0,
        pv=np.full(n, 50.0) if pv is None else pv,
        op=50 + np.sin(np.arange(n)) if op is None else op,
        sp=np.full(n, 50.0) if sp is None else sp,
        mode=None if mode is None else np.asarray(mode, dtype=np.int8),
        pv_range=pv_range,
    )


def test_the_service_factor_counts_only_time_with_a_known_mode() -> None:
    mode = np.repeat([Mode.AUTO, Mode.MAN, Mode.CAS, Mode.UNKNOWN], 90)
    used = usage(hour(mode=mode))
    assert used.service_factor == pytest.approx(180 / 270)
    assert dict(used.modes) == {"UNKNOWN": 0.25, "MAN": 0.25, "AUTO": 0.25, "CAS": 0.25}
    assert usage(hour()).service_factor is None
    assert usage(hour()).basis.reasons == ("the mode was not recorded",)


def test_travel_and_reversals_of_a_triangle_are_those_of_its_geometry() -> None:
    k = np.arange(361)[:360]
    triangle = 40 + np.abs((k % 60) - 30.0)  # six periods of 60 samples, 60 % a period
    used = usage(hour(op=triangle))
    per_day = 86_400 / (359 * 10.0)
    assert used.travel == pytest.approx(np.sum(np.abs(np.diff(triangle))) * per_day)
    assert used.reversals == pytest.approx(11 / (359 * 10 / 3600))


def test_saturation_is_told_by_limit() -> None:
    op = np.r_[np.full(36, 100.0), np.full(72, 0.0), np.full(252, 40.0)]
    used = usage(hour(op=op))
    assert (used.saturated_high, used.saturated_low) == pytest.approx((0.1, 0.2))
    assert used.saturated == pytest.approx(0.3)


def test_the_effective_service_factor_wants_automatic_free_output_and_a_small_error() -> None:
    mode = np.r_[np.full(90, Mode.MAN), np.full(270, Mode.AUTO)]
    op = np.r_[np.full(180, 50.0), np.full(90, 100.0), np.full(90, 50.0)]
    pv = np.r_[np.full(300, 50.0), np.full(60, 53.0)]
    used = usage(hour(mode=mode, op=op, pv=pv))
    assert used.effective_service_factor == pytest.approx((90 + 30) / 360)
    assert usage(hour(mode=mode, pv_range=None)).effective_service_factor is None
    lost = hour(mode=mode, pv=np.full(360, np.nan))
    assert usage(lost).effective_service_factor is None


def test_hands_on_the_loop_are_counted_a_day() -> None:
    mode = np.repeat([Mode.AUTO, Mode.MAN, Mode.AUTO], 120)
    op = np.full(360, 50.0)
    op[150:] += 5  # one move
    op[180:190] += np.arange(1, 11)  # a ramp by hand counts once
    op[190:] += 10
    used = usage(hour(mode=mode, op=op))
    assert used.mode_changes == pytest.approx(2 * 24)
    assert used.manual_moves == pytest.approx(2 * 24)


def test_without_outputs_only_the_modes_are_told() -> None:
    used = usage(hour(mode=np.full(360, Mode.AUTO), op=np.full(360, np.nan)))
    assert used.basis.refused
    assert used.service_factor == 1.0
    assert used.travel is used.saturated is used.manual_moves is None


def test_error_statistics_are_those_of_the_samples_in_automatic() -> None:
    rng = np.random.default_rng(0)
    pv = 50 + rng.normal(0.4, 2.0, 360)
    mode = np.repeat([Mode.AUTO, Mode.MAN], 180)
    found = error_statistics(hour(pv=pv, mode=mode, pv_range=(0.0, 200.0)), limits=(48.0, 100.0))
    e = 50 - pv[:180]
    assert found.mean == pytest.approx(sum(e) / 180)
    assert found.sd_percent == pytest.approx(np.sqrt(np.mean(e**2) - np.mean(e) ** 2) / 2)
    assert found.mean_absolute == pytest.approx(sum(abs(e)) / 180)
    assert found.outside == pytest.approx(np.mean(pv < 48))
    assert error_statistics(hour(pv=pv, pv_range=None)).mean_percent is None


def test_an_error_that_is_not_known_is_refused() -> None:
    silent = LoopSignals(dt=1.0, pv=np.ones(50), op=np.ones(50))
    assert error_statistics(silent).basis.reasons == ("no set point was recorded",)
    by_hand = hour(mode=np.full(360, Mode.MAN))
    assert error_statistics(by_hand).basis.confidence is Confidence.NONE


def test_the_controlled_stretch_bridges_short_gaps_and_stops_at_long_ones() -> None:
    pv = np.linspace(0, 359, 360)
    pv[100:103] = np.nan
    pv[300:310] = np.nan
    stretch = controlled_stretch(hour(pv=pv, mode=np.full(360, Mode.AUTO)))
    assert stretch is not None
    assert (stretch.first, stretch.pv.size) == (0, 300)
    np.testing.assert_allclose(stretch.pv, np.arange(300.0))
    assert stretch.share == pytest.approx(300 / 360)


def test_nothing_is_controlled_in_manual_or_at_a_limit() -> None:
    assert controlled_stretch(hour(mode=np.full(360, Mode.MAN))) is None
    assert controlled_stretch(hour(op=np.full(360, 100.0))) is None
    assert controlled_stretch(hour(mode=np.full(360, Mode.UNKNOWN))) is not None
    without_sp = controlled_stretch(hour(sp=np.full(360, np.nan)))
    assert without_sp is not None
    assert without_sp.sp is None
    np.testing.assert_array_equal(without_sp.error, 0.0)


@pytest.mark.parametrize(
    ("signals", "why"),
    [
        (LoopSignals(dt=1.0, pv=np.ones(3), op=np.ones(3)), "3 samples"),
        (hour(pv=np.full(360, np.nan)), "0 samples"),
        (hour(op=np.full(360, 50.0)), "neither PV nor OP ever moves"),
        (hour(pv=np.full(360, 5000.0)), "100% of PV lie outside its range 0 to 100"),
        (hour(op=800 + np.arange(360.0), pv_range=None), "100% of OP lie outside"),
    ],
)
def test_signals_that_cannot_be_judged_say_why(signals: LoopSignals, why: str) -> None:
    reason = unfit(signals)
    assert reason is not None
    assert why in reason


def test_signals_that_can_be_judged_are_fit() -> None:
    assert unfit(hour()) is None


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"dt": 0.0}, "dt must be positive"),
        ({"op": np.ones(4)}, "op must be as long as pv"),
        ({"pv_range": (5.0, 5.0)}, "pv_range must rise"),
    ],
)
def test_impossible_signals_are_refused(changes: dict[str, Any], why: str) -> None:
    given: dict[str, Any] = {"dt": 1.0, "pv": np.ones(5), "op": np.ones(5)}
    with pytest.raises(ValueError, match=why):
        LoopSignals(**(given | changes))


def test_every_doubt_takes_one_grade_and_low_is_the_floor() -> None:
    assert graded(0.9).confidence is Confidence.HIGH
    assert graded(0.4).confidence is Confidence.MEDIUM
    assert graded(0.4, ("a", "b", "c")).confidence is Confidence.LOW


def slow_reversals(op: Real, dead_band: float) -> int:
    """Follow OP sample by sample: it turns where it has come back by the dead band."""
    high = low = op[0]
    way = turns = 0
    for value in op:
        high, low = max(high, value), min(low, value)
        if way >= 0 and high - value >= dead_band:
            turns, way, low = turns + (way > 0), -1, value
        elif way <= 0 and value - low >= dead_band:
            turns, way, high = turns + (way < 0), 1, value
        if way > 0:
            low = value
        elif way < 0:
            high = value
    return int(turns)


@given(
    seed=st.integers(0, 10_000),
    n=st.integers(1, 300),
    digits=st.integers(0, 4),
    dead_band=st.floats(0.05, 4.0),
)
def test_reversals_are_those_of_a_walk_along_the_output(
    seed: int, n: int, digits: int, dead_band: float
) -> None:
    rng = np.random.default_rng(seed)
    op = np.round(np.cumsum(rng.normal(size=n)) if seed % 2 else rng.normal(size=n), digits)
    assert reversals_of(op, dead_band) == slow_reversals(op, dead_band)


@pytest.mark.parametrize("dt", [1.0, 10.0, 60.0])
def test_reversals_do_not_depend_on_the_sample_time(dt: float) -> None:
    t = np.arange(0.0, 36_000.0, dt)
    slow = LoopSignals(dt=dt, pv=np.zeros(t.size), op=50 + 4 * np.cos(2 * np.pi * t / 600))
    assert usage(slow).reversals == pytest.approx(12, rel=0.02)


def test_an_output_that_flickers_below_the_dead_band_never_turns() -> None:
    assert reversals_of(np.tile([50.0, 50.01], 40_000), 0.05) == 0
