import numpy as np
import pytest

from benchmarks.answer_weights import Table, limits
from benchmarks.stiction_windows import by_size, judged, reliability
from benchmarks.virtual_windows import NEITHER, Family, Truth, windows
from loop.signals import Real
from loop.valve import Choudhury, stem_positions
from monitoring.answer_model import JOINT_NAMES, WaveWord, answer_model, joint_vector
from monitoring.loop_signals import Stretch
from monitoring.oscillation import oscillation
from monitoring.stiction import NOTHING_KNOWN, STILL_PRIOR, stiction
from monitoring.stiction_result import StictionVerdict
from monitoring.valve_answers import (
    MOST_BLOCKS,
    NAMES,
    ValveAnswers,
    behind_lost_motion,
    turning_points,
    valve_answers,
)

# Sample time, samples and scans a sample: quickly simulated.
SHORT = ((10.0, 300, 1),)


def answered(op: Real, pv: Real, sp: float) -> ValveAnswers:
    found = valve_answers(op, pv, sp - pv, op_span=100.0, integrating=False)
    assert found is not None
    assert found.vector.size == len(NAMES)
    assert np.all(np.isfinite(found.vector))
    return found


def test_lost_motion_is_the_valve_model_without_a_slip_jump() -> None:
    op = np.cumsum(np.random.default_rng(1).normal(size=400))
    scanned = behind_lost_motion(op, np.array([0.0, 3.0]))
    np.testing.assert_allclose(scanned[:, 0], op)
    position = op[0]
    for k, u in enumerate(op):
        position = min(max(position, u - 1.5), u + 1.5)
        assert scanned[k, 1] == pytest.approx(position)
    stem = stem_positions(Choudhury(S=3.0, J=0.0), op)
    assert np.median(np.abs(stem - scanned[:, 1])) < 1e-9


def test_turning_points_are_where_a_signal_comes_back() -> None:
    wave = np.sin(2 * np.pi * np.arange(200) / 40)
    assert turning_points(wave, 0.5) == [10, 30, 50, 70, 90, 110, 130, 150, 170, 190]
    assert turning_points(-wave, 0.5) == turning_points(wave, 0.5)
    assert turning_points(wave, 2.5) == []


def test_an_output_that_ramps_against_a_standing_error_is_unanswered() -> None:
    t = np.arange(750.0)
    noise = np.random.default_rng(2).normal(size=t.size)
    triangle = 25 + 2 * np.abs((t / 250) % 2 - 1)
    offset = np.where((t // 250) % 2 == 0, 1.0, -1.0)
    stuck = answered(triangle, 50 + offset + 0.1 * noise, 50.0)
    follows = answered(triangle, 50 + 2 * (triangle - 26) + 0.1 * noise, 50.0)
    assert stuck.unanswered > 0.9
    assert follows.unanswered < 0.1
    assert follows.correlation > 0.99


def test_numbers_do_not_depend_on_the_units() -> None:
    one = next(iter(windows(Family.FLOW, 6, sticking=True, seed=3, grids=SHORT)))
    first = answered(one.op, one.pv, 0.0)
    other = valve_answers(0.01 * one.op, 7 * one.pv, -7 * one.pv, op_span=1.0, integrating=False)
    assert other is not None
    np.testing.assert_allclose(other.vector, first.vector, rtol=1e-5, atol=1e-5)
    assert other.op_range == pytest.approx(first.op_range)
    # How far OP moves depends on the loads, which a simulation invents: it is not weighed.
    smaller = valve_answers(one.op, one.pv, -one.pv, op_span=5000.0, integrating=False)
    assert smaller is not None
    np.testing.assert_array_equal(smaller.vector, first.vector)


def test_what_cannot_be_measured_has_no_numbers() -> None:
    ramp, level = np.arange(200.0), np.zeros(200)
    for op, pv in ((level, ramp), (ramp, level), (ramp[:20], ramp[:20])):
        assert valve_answers(op, pv, -pv, op_span=100.0, integrating=False) is None


def test_a_pv_that_stands_still_may_be_the_valve_or_the_measurement() -> None:
    n = 400

    def said(op: Real) -> tuple[float | None, StictionVerdict]:
        stretch = Stretch(first=0, dt=10.0, pv=np.zeros(n), op=op, sp=np.full(n, 0.1), share=1.0)
        found = stiction(stretch, oscillation(stretch.error, 10.0))
        return found.probability, found.verdict

    assert said(np.linspace(10, 20, n)) == (STILL_PRIOR, StictionVerdict.UNDECIDED)
    assert said(np.linspace(10, 10.1, n)) == (NOTHING_KNOWN, StictionVerdict.UNDECIDED)
    assert said(np.full(n, 10.0)) == (None, StictionVerdict.UNDECIDED)
    short = Stretch(first=0, dt=1.0, pv=np.arange(40.0), op=np.arange(40.0), sp=None, share=1.0)
    refused = stiction(short, oscillation(short.error, 1.0))
    assert refused.probability is None
    assert refused.basis.reasons == ("fewer than 100 samples",)


def test_the_joint_weights_trust_both_words() -> None:
    model = answer_model()

    def said(answers: float, wave: float) -> float:
        word = WaveWord(probability=wave, clear=True, share=0.8, op_likeness=0.9, pv_likeness=0.9)
        return float(model.together(joint_vector(answers, word)[None])[0])

    assert said(0.9, 0.1) > said(0.1, 0.1)
    assert said(0.1, 0.9) > said(0.1, 0.1)
    assert 0 < model.none_below <= model.stiction_from < 1
    row = joint_vector(0.0, WaveWord(probability=1.0, clear=True)).tolist()
    assert row == [-8.0, 8.0, 1.0, 0.0, 0.0, 0.0]
    assert len(row) == len(JOINT_NAMES)


def test_simulated_windows_are_told_apart() -> None:
    found = [
        judged(one)
        for family in (Family.PRESSURE, Family.LEVEL)
        for sticking in (False, True)
        for one in windows(family, 16, sticking=sticking, seed=77, grids=SHORT)
    ]
    healthy = [one.probability for one in found if one.truth is Truth.HEALTHY]
    stuck = [one.probability for one in found if one.truth is Truth.STICKING]
    assert np.median(stuck) > 0.5 > np.median(healthy)
    assert sum(n for _, _, n in reliability(found)) == sum(
        one.truth not in NEITHER for one in found
    )
    assert sum(row[3] for row in by_size(found)) == len(stuck)


def test_all_families_and_truths_are_drawn_and_repeat_by_their_seed() -> None:
    for family in Family:
        first, again = (
            list(windows(family, 4, sticking=False, seed=5, grids=SHORT)) for _ in range(2)
        )
        assert [one.truth for one in first] == [one.truth for one in again]
        assert all(np.array_equal(a.pv, b.pv) for a, b in zip(first, again, strict=True))
        assert all(one.S <= 0.25 and np.ptp(one.op) > 0 for one in first)


def test_limits_leave_few_undecided() -> None:
    p = np.linspace(0.0, 1.0, 400)
    truths = np.where(np.arange(400) < 200, Truth.HEALTHY.value, Truth.STICKING.value)
    groups = np.where(np.arange(400) % 2, "flow", "750")
    table = Table(
        vectors=np.zeros((400, len(NAMES))),
        words=(WaveWord(),) * 400,
        op_ranges=np.ones(400),
        truths=truths,
        groups=groups,
    )
    upper, lower = limits(p, table)
    assert lower <= 0.5 <= upper == pytest.approx(0.5, abs=0.01)
    windows_of = p[:200][groups[:200] == "flow"]
    assert np.mean((windows_of >= lower) & (windows_of < upper)) <= 0.17


def test_a_day_of_seconds_is_cut_into_a_bounded_number_of_blocks() -> None:
    rng = np.random.default_rng(4)
    op, pv = 50 + np.cumsum(rng.normal(size=86_400)) / 100, rng.normal(size=86_400)
    assert 86_400 / answered(op, pv, 0.0).block <= MOST_BLOCKS
