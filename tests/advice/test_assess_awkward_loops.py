"""What is said of loops whose data, mode or range are not what they should be."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from advice.assess import Assessment, assess
from loop.controller import PID
from loop.process import FOPDT
from loop.record import Mode, Record
from loop.signals import Real
from loop.simulation import simulate
from monitoring.basis import Confidence
from monitoring.cause import Action, Cause
from monitoring.diagnosis import diagnose
from monitoring.loop_signals import LoopKind
from monitoring.score_profile import PARTS, profile_of, score_profile
from monitoring.scorecard import GradeWord
from monitoring.stiction_result import StictionVerdict

N = 1500
LIMITS = {
    "service_factor_least": 0.5, "saturated_most": 0.3, "clipped_most": 0.05, "good_least": 0.7,
    "eta_least": 0.3,
}  # fmt: skip
ROW = dict.fromkeys(PARTS, 0.2) | {"performance": 0.0, "error_sd_percent_most": 2.0}
PROCESS = FOPDT(K=1.0, tau=60.0, theta=10.0)
SQUARE = np.where((np.arange(N) // 150) % 2 == 0, 50.0, 55.0)


def found(
    *, Kc: float = 1.5, sp: float | Real = 50.0, sp_unit: float = 1.0, **changes: Any
) -> Assessment:
    run = simulate(
        PROCESS, PID(Kc=Kc, Ti=60.0), t_end=(N - 1) * 5.0, dt=5.0, sp=sp, pv0=50.0, op0=50.0,
        noise=0.2, rng=np.random.default_rng(1),
    )  # fmt: skip
    signals = {"t": run.t, "pv": run.pv, "op": run.op, "sp": run.sp}
    signals["mode"] = np.full(N, Mode.AUTO, dtype=np.int8)
    for name, change in changes.items():
        signals[name] = change(signals[name]) if callable(change) else change
    signals["sp"] = signals["sp"] * sp_unit
    kept = np.isfinite(signals["t"])
    record = Record(**{name: signal[kept] for name, signal in signals.items()})
    return assess(record, kind="temperature", pv_range=(0.0, 100.0))


def gap(t: Real) -> Real:
    return np.where((np.arange(N) >= 300) & (np.arange(N) < 800), np.nan, t)


def test_a_gap_of_the_recording_is_no_bad_sensor() -> None:
    assert found(t=gap).diagnosis.cause is Cause.HEALTHY
    lost = found(pv=gap)
    assert lost.diagnosis.cause is Cause.SENSOR
    assert "67%" in lost.diagnosis.evidence[0]


@pytest.mark.parametrize(
    "changes",
    [
        {"op": lambda op: op / 100},
        {"pv": lambda pv: pv / 100, "sp_unit": 0.01},
    ],
    ids=["OP", "PV"],
)
def test_a_fraction_of_one_is_not_judged_as_a_percentage(changes: dict[str, Any]) -> None:
    answer = found(**changes)
    assert answer.diagnosis.cause is Cause.NOT_ASSESSABLE
    assert answer.diagnosis.action is Action.GET_DATA
    assert "check the unit" in answer.diagnosis.evidence[0]


def test_a_valve_that_rests_closed_is_constrained_and_not_of_another_unit() -> None:
    answer = found(op=np.where(np.arange(N) % 10 == 0, 0.5, 0.0))
    assert answer.diagnosis.cause is Cause.CONSTRAINT


def test_an_output_that_never_moves_is_not_healthy() -> None:
    answer = found(op=np.full(N, 40.0))
    assert answer.diagnosis.cause is Cause.NOT_IN_USE
    assert answer.grade.points == 0


def test_a_loop_that_never_gets_to_its_set_point_is_not_healthy() -> None:
    slow = found(Kc=0.1, sp=SQUARE)
    assert (slow.diagnosis.cause, slow.diagnosis.action) == (Cause.TUNING, Action.RETUNE)
    assert "9 of 9 set-point moves" in slow.diagnosis.evidence[0]


def test_a_large_error_that_nothing_explains_is_said_and_not_sure_to_be_healthy() -> None:
    drift = np.cumsum(np.random.default_rng(3).normal(0, 0.1, N))
    answer = found(pv=lambda pv: pv + drift - drift.mean())
    assert answer.diagnosis.cause is Cause.HEALTHY
    assert answer.diagnosis.confidence is Confidence.LOW
    assert any("standard deviation" in sentence for sentence in answer.diagnosis.evidence)


def test_a_loop_without_a_set_point_is_not_surely_healthy() -> None:
    assert found().diagnosis.confidence is Confidence.HIGH
    blind = found(sp_unit=np.nan)
    assert blind.diagnosis.confidence is Confidence.LOW
    assert any("no set point" in sentence for sentence in blind.diagnosis.evidence)


@pytest.mark.parametrize(
    ("changes", "most"),
    [
        ({"mode": np.full(N, Mode.MAN)}, 0.0),
        ({"op": np.full(N, 100.0)}, 0.0),
        ({"op": lambda op: np.where(np.arange(N) % 2, 100.0, op)}, 50.0),
        ({"pv": np.full(N, 50.0)}, 0.0),
        ({"pv": lambda pv: np.minimum(pv, 50.1)}, 70.0),
    ],
    ids=["manual", "at a limit", "at a limit half the time", "frozen", "clipped"],
)
def test_no_grade_is_better_than_the_time_in_which_the_loop_could_control(
    changes: dict[str, Any], most: float
) -> None:
    answer = found(**changes)
    assert answer.grade.points is not None
    assert answer.grade.points <= most


def test_a_loop_whose_mode_changes_all_the_time_has_no_grade_and_says_why() -> None:
    answer = found(mode=(np.arange(N) % 25 < 15).astype(np.int8))
    assert answer.diagnosis.cause is Cause.NOT_ASSESSABLE
    assert answer.grade.word is GradeWord.NOT_ASSESSABLE
    assert not answer.assessable
    assert "the mode changes" in answer.diagnosis.evidence[0]


def test_a_coarse_pv_is_not_called_frozen() -> None:
    answer = found(pv=np.round)
    assert answer.diagnosis.cause is Cause.SENSOR
    assert "in steps of 1" in answer.diagnosis.evidence[0]
    assert answer.diagnosis.others == ()


def test_a_valve_that_works_in_its_lowest_fifth_is_told() -> None:
    answer = found(op=lambda op: op - 40.0)
    assert any("oversized" in sentence for sentence in answer.diagnosis.evidence)


def test_too_few_samples_for_an_oscillation_do_not_make_a_healthy_loop() -> None:
    answer = found(t=lambda t: np.where(np.arange(N) < 50, t, np.nan))
    assert answer.diagnosis.cause is Cause.NOT_ASSESSABLE
    assert answer.indices is not None
    assert "50 samples" in answer.diagnosis.evidence[0]
    assert answer.grade.points is None


def test_a_healthy_loop_whose_valve_is_undecided_names_the_valve_and_is_less_sure() -> None:
    sure = found()
    assert sure.indices is not None
    assert sure.indices.control is not None
    doubtful = replace(sure.indices.control.stiction, verdict=StictionVerdict.UNDECIDED)
    control = replace(sure.indices.control, stiction=doubtful)
    said = diagnose(replace(sure.indices, control=control), score_profile(sure.kind))
    assert (said.cause, said.others) == (Cause.HEALTHY, (Cause.VALVE,))
    assert (sure.diagnosis.confidence, said.confidence) == (Confidence.HIGH, Confidence.MEDIUM)
    assert any("put the loop in manual" in sentence for sentence in said.evidence)


def test_a_wave_from_outside_that_keeps_its_phase_is_sought_upstream() -> None:
    wave = np.sin(2 * np.pi * np.arange(N) / 24)
    answer = found(pv=lambda pv: pv + wave)
    assert answer.diagnosis.cause is Cause.DISTURBANCE
    assert answer.diagnosis.action is Action.LOOK_UPSTREAM
    assert answer.diagnosis.confidence is Confidence.LOW
    assert "keeps its phase" in answer.diagnosis.evidence[-1]
    assert Cause.TUNING in answer.diagnosis.others


def test_idle_responses_to_loads_are_sluggish_tuning() -> None:
    sure = found()
    assert sure.indices is not None
    assert sure.indices.control is not None
    loads = replace(sure.indices.control.load_responses, sluggish=True, idle_index=0.62)
    control = replace(sure.indices.control, load_responses=loads)
    said = diagnose(replace(sure.indices, control=control), score_profile(sure.kind))
    assert (said.cause, said.action) == (Cause.TUNING, Action.RETUNE)
    assert "0.62" in said.evidence[0]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"kinds": []}, "holds limits and kinds"),
        ({"kinds": {"flow": ROW | {"use": 0.5}}}, "must sum to 1"),
    ],
)
def test_a_profile_that_cannot_be_is_refused(change: dict[str, Any], why: str) -> None:
    body = {"name": "mine", "source": "nobody", "limits": LIMITS, "kinds": {"flow": ROW}}
    assert profile_of(body, LoopKind.FLOW).weights[0] == ("use", 0.2)
    with pytest.raises(ValueError, match=why):
        profile_of(body | change, LoopKind.FLOW)
