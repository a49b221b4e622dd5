"""The walk from a record to a model: what is trusted, what is refused, and why."""

import re
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from identification.held_input import HeldInput, lag_response
from identification.identify import Identification, identify
from identification.verdict import Verdict
from loop.process import FOPDT, IPDT, SOPDT
from loop.record import Mode, Record

K, TAU, THETA = 2.0, 60.0, 12.4
T = np.arange(0.0, 600.0)


def output(*moves: tuple[float, float], t: np.ndarray = T, at_first: float = 40.0) -> np.ndarray:
    op = np.full(t.size, at_first)
    for instant, level in moves:
        op[t >= instant] = level
    return op


STEP = output((100, 50))


def answer(
    op: np.ndarray,
    *,
    t: np.ndarray = T,
    process: tuple[float, float, float] = (K, TAU, THETA),
    noise: float = 0.2,
    drift: float = 0.0,
    start: float = 0.0,
    op_before: float | None = None,
    seed: int = 1,
) -> np.ndarray:
    gain, tau, theta = process
    held = HeldInput.from_samples(t, op, op_before)
    pv = 20 + gain * lag_response(held, t, tau, theta)[0] if held.moves else np.full(t.size, 20.0)
    pv = pv + drift * (t - t[0]) + start * np.exp(-(t - t[0]) / tau)
    return np.asarray(pv + np.random.default_rng(seed).normal(0, noise, t.size))


def of(pv: np.ndarray, op: np.ndarray = STEP, t: np.ndarray = T, **more: object) -> Identification:
    return identify(Record(t=t, pv=pv, op=op, **more))


def model(found: Identification) -> tuple[float, float, float]:
    assert isinstance(found.fitted, FOPDT)
    return found.fitted.K, found.fitted.tau, found.fitted.theta


def said(found: Identification) -> str:
    return " ".join(found.reasons)


def assert_refused(found: Identification, words: str) -> None:
    assert found.verdict is Verdict.REFUSED
    assert found.process is None
    assert re.search(words, found.reasons[0]), found.reasons


def test_a_clean_step_is_trusted_and_says_why() -> None:
    found = of(answer(STEP))
    assert found.verdict is Verdict.TRUSTED
    assert found.kind == "FOPDT"
    assert isinstance(found.process, FOPDT)
    assert found.process == found.fitted
    assert model(found)[0] == pytest.approx(K, rel=0.01)
    assert found.process.tau == pytest.approx(TAU, rel=0.03)
    assert found.process.theta == pytest.approx(THETA, abs=1)
    assert found.noise_sd == pytest.approx(0.2, rel=0.15)
    assert found.pv0 == pytest.approx(20, abs=0.1)
    assert (found.drift, found.drift_error, found.start) == (0, 0, 0)
    assert (found.rows, found.samples, found.spikes) == (600, 600, 0)
    assert (found.span, found.longest_gap) == (599, 1)
    for words in ("100% of the final change", "Smith's two points agree", "white noise", "(95 %)"):
        assert words in said(found)
    (reading,) = found.steps
    assert (reading.step.start, reading.steady_before, reading.steady_after) == (100, True, True)
    assert reading.two_point is not None
    assert reading.two_point.process.tau == pytest.approx(TAU, rel=0.15)


def test_residual_and_prediction_belong_together() -> None:
    found = of(answer(STEP))
    assert found.t is not None
    assert found.pv is not None
    assert found.predicted is not None
    np.testing.assert_allclose(found.pv - found.predicted, found.residual)
    spread = np.linalg.norm(found.pv - found.pv.mean())
    assert found.fit_percent == pytest.approx(
        100 * (1 - np.linalg.norm(found.pv - found.predicted) / spread)
    )
    assert found.correlation is not None
    np.testing.assert_allclose(np.diag(found.correlation), 1)


def test_without_noise_the_model_is_exact() -> None:
    found = of(answer(STEP, noise=0))
    assert model(found) == pytest.approx((K, TAU, THETA), rel=1e-6)
    assert "without noise" in said(found)


def test_intervals_hold_in_19_records_of_20() -> None:
    truth, inside = np.array([K, TAU, THETA]), []
    for seed in range(120):
        found = of(answer(STEP, noise=0.5, seed=seed))
        assert found.intervals is not None
        assert found.verdict is Verdict.TRUSTED
        inside.append((found.intervals[:, 0] < truth) & (truth < found.intervals[:, 1]))
    np.testing.assert_allclose(np.mean(inside, axis=0), 0.95, atol=0.06)


def test_several_steps_up_and_down_agree_on_the_gain() -> None:
    op = output((100, 50), (250, 43), (420, 48))
    found = of(answer(op), op)
    assert found.verdict is Verdict.TRUSTED
    assert found.gains is not None
    np.testing.assert_allclose(found.gains.gains, K, rtol=0.05)
    assert "steps agree on the gain" in said(found)
    assert len(found.steps) == 3


def test_a_ramp_is_as_good_as_a_step() -> None:
    op = 40 + np.clip((T - 100) / 3, 0, 10)
    found = of(answer(op), op)
    assert found.verdict is Verdict.TRUSTED
    assert model(found)[2] == pytest.approx(THETA, abs=1)


def test_a_noisy_output_is_averaged_over_its_holds() -> None:
    op = STEP + np.random.default_rng(3).normal(0, 0.3, T.size)
    found = of(answer(STEP), op)
    assert found.verdict is Verdict.TRUSTED
    assert "averaged over its" in said(found)


@pytest.mark.parametrize(
    ("op", "drift", "told"),
    [
        (STEP, 0.01, "before the first move"),
        (output((20, 50)), 0.005, "white residual"),
        (output((20, 50), (300, 42)), -0.004, "white residual"),
    ],
)
def test_a_drift_is_fitted_where_the_record_shows_it(
    op: np.ndarray, drift: float, told: str
) -> None:
    found = of(answer(op, drift=drift), op)
    assert found.drift == pytest.approx(drift, rel=0.1)
    assert model(found)[0] == pytest.approx(K, rel=0.02)
    assert model(found)[1] == pytest.approx(TAU, rel=0.04)
    assert told in said(found)


def with_slow_tail(op: np.ndarray, noise: float) -> np.ndarray:
    pv = answer(op, noise=noise)
    return np.asarray(pv + answer(op, process=(0.25, 500.0, THETA), noise=0) - 20)


def test_a_slow_tail_is_not_taken_for_a_drift_and_both_readings_are_stated() -> None:
    found = of(with_slow_tail(STEP, 0.02))
    assert found.drift == 0
    assert "slow tail of the process or by a drift" in said(found)
    assert "with a drift of" in said(found)


def test_coloured_noise_with_a_drift_over_moves_both_ways_is_told_apart() -> None:
    rng = np.random.default_rng(0)
    op = output((10, 50), (200, 42), (380, 50))
    noise = lfilter([0.02], [1, -0.9], rng.normal(size=T.size))
    found = of(answer(op, noise=0, drift=0.05) + noise, op)
    assert found.drift == pytest.approx(0.05, rel=0.05)
    assert "explains most of what a model without it misses" in said(found)


def test_an_unsteady_start_is_fitted_where_it_shows() -> None:
    found = of(answer(STEP, start=6))
    assert found.start == pytest.approx(6, abs=0.5)
    assert model(found)[1] == pytest.approx(TAU, rel=0.03)
    assert "off rest" in said(found)


def test_an_unsteady_start_without_samples_before_the_move_is_not_fitted() -> None:
    op = output((3, 50))
    assert of(answer(op, start=6), op).start == 0


def test_a_bump_before_the_step_is_told() -> None:
    pv = answer(STEP)
    pv[40:70] += 4
    found = of(pv)
    assert found.verdict is not Verdict.TRUSTED
    assert re.search("PV moved before the step: by .* of the answer between", said(found))


def test_a_record_that_ends_at_once_determines_nothing() -> None:
    found = of(answer(STEP, noise=0.05)[:121], STEP[:121], T[:121])
    assert found.verdict is Verdict.REFUSED
    assert "not determined by the record" in said(found)


def test_an_answer_that_is_over_at_once_is_not_called_saturated() -> None:
    assert "saturated" not in said(of(answer(STEP, process=(2, 0.1, 3.2), noise=0)))


def test_coloured_residuals_widen_the_errors() -> None:
    rng = np.random.default_rng(0)
    coloured = lfilter([0.1], [1, -0.95], rng.normal(size=T.size))
    found = of(answer(STEP, noise=0) + coloured)
    assert found.colour is not None
    assert not found.colour.white
    assert found.colour.inflation > 5
    assert "not white" in said(found)
    assert found.intervals is not None
    assert found.intervals[1, 0] < TAU < found.intervals[1, 1]


def test_spikes_are_left_out_and_counted() -> None:
    pv = answer(STEP)
    pv[[50, 130, 131, 300, 480]] += [15, -20, 18, 9, -30]
    found = of(pv)
    assert found.spikes == 5
    assert found.samples == 595
    assert "5 single readings" in said(found)
    assert model(found)[1] == pytest.approx(TAU, rel=0.03)


def test_two_equal_lags_are_told_from_one_and_the_error_of_one_is_stated() -> None:
    fine = np.arange(0, 600, 0.1)
    x = lag_response(HeldInput(instants=np.array([100.0]), levels=np.array([0, 10.0])), fine, 40, 9)
    a = np.exp(-0.1 / 40)
    pv = 20 + 2 * lfilter([1 - a], [1, -a], x[0])[::10]
    found = of(pv + np.random.default_rng(0).normal(0, 0.1, T.size))
    assert found.kind == "SOPDT"
    assert isinstance(found.process, SOPDT)
    assert found.process.tau1 + found.process.tau2 == pytest.approx(80, rel=0.02)
    off = re.search(r"one lag, which misses PV by up to ([\d.]+) %", said(found))
    assert off is not None
    assert 2 < float(off.group(1)) < 6


@pytest.mark.parametrize(
    ("stop", "verdict", "words"),
    [
        (130, Verdict.REFUSED, "PV is still moving, K and tau trade off"),
        (172, Verdict.CARE, "K/tau = 0.03"),
        (235, Verdict.TRUSTED, "K/tau = 0.03"),
    ],
)
def test_a_record_that_ends_before_settling_knows_only_k_over_tau(
    stop: int, verdict: Verdict, words: str
) -> None:
    found = of(answer(STEP, noise=0.05)[:stop], STEP[:stop], T[:stop])
    assert found.verdict is verdict
    assert words in said(found)


def test_an_integrating_process_is_told_by_its_ramp() -> None:
    pv = 20 + 0.05 * np.maximum(T - 112, 0) + np.random.default_rng(0).normal(0, 0.1, T.size)
    found = of(pv)
    assert found.verdict is Verdict.TRUSTED
    assert isinstance(found.process, IPDT)
    gain = found.process.K
    assert gain == pytest.approx(0.005, rel=0.01)
    assert found.process.theta == pytest.approx(12, abs=1)
    assert "PV shows no settling" in said(found)


def test_the_output_before_the_first_row_is_used_only_when_stated() -> None:
    op = np.full(T.size, 50.0)
    pv = answer(op, op_before=40.0)
    stated = of(pv, op, op_before=40.0)
    assert stated.verdict is Verdict.TRUSTED
    assert model(stated)[0] == pytest.approx(K, rel=0.02)
    assert stated.steps[0].steady_before is None
    assert "taken as 40, as stated" in said(stated)
    assert_refused(of(pv, op), "--op-before")


@pytest.mark.parametrize(
    ("pv", "op", "words"),
    [
        pytest.param(answer(STEP), np.full(600, 40.0), "no move in OP", id="no move"),
        pytest.param(np.full(600, 20.0), STEP, "Nothing moved in PV", id="constant PV"),
        pytest.param(
            answer(STEP, process=(0, 1, 1)), STEP, "Nothing in PV follows", id="no answer"
        ),
        pytest.param(answer(STEP, noise=9), STEP, "too small for the noise", id="noise"),
        pytest.param(
            answer(output((60, 50))), output((100, 50)), "PV moved before OP", id="cause second"
        ),
        pytest.param(np.minimum(answer(STEP), 33), STEP, "saturated", id="cut off above"),
        pytest.param(
            np.maximum(answer(output((100, 30))), 7), output((100, 30)), "saturated", id="below"
        ),
        pytest.param(
            answer(output((100, 50), (300, 60))),
            output((100, 50), (300, 40)),
            "differ in sign",
            id="signs",
        ),
        pytest.param(20 + 0.05 * T, STEP, "Nothing in PV follows", id="only a drift"),
        pytest.param(np.where(T < 300, 20, 1e300), STEP, "no measurement", id="absurd value"),
        pytest.param(np.full(600, np.nan), STEP, "Only 0 samples", id="no PV"),
        pytest.param(answer(STEP), np.full(600, np.nan), "Only 0 samples", id="no OP"),
    ],
)
def test_bad_data_are_refused_in_words(pv: np.ndarray, op: np.ndarray, words: str) -> None:
    assert_refused(of(pv, op), words)


def test_a_short_pulse_that_noise_hides_is_refused() -> None:
    op = output((100, 50), (110, 40))
    assert_refused(of(answer(op, noise=1.5), op), "too small for the noise|Nothing in PV follows")


def test_a_hot_start_that_ends_where_it_began_is_no_answer() -> None:
    pv = 72.7 + 2 * (np.exp(-np.maximum(T - 100, 0) / 90) - 1) * (T < 160) + 0.01 * (T > 160)
    pv += np.random.default_rng(0).normal(0, 0.4, T.size)
    assert_refused(of(pv), "follow")


def test_two_samples_are_refused() -> None:
    found = identify(Record(t=[0, 1], pv=[1, 2], op=[3, 4]))
    assert_refused(found, "Only 2 samples")
    assert (found.rows, found.samples, found.span, found.longest_gap) == (2, 0, 1, 1)


def test_a_single_row_is_refused() -> None:
    assert identify(Record(t=[0], pv=[1], op=[3])).longest_gap == 0


def test_a_record_of_no_length_is_refused() -> None:
    t = np.arange(20) * 1e-9
    assert_refused(identify(Record(t=t, pv=np.arange(20.0), op=np.arange(20) > 9)), "spans only")


def test_a_gain_beyond_any_model_is_refused() -> None:
    op = 40 + 1e-10 * (T > 100)
    assert_refused(of(answer(output((100, 50))), op), "K must lie within")


def test_gaps_are_told_and_weighed() -> None:
    pv = answer(STEP)
    pv[300:310] = np.nan
    assert "10 of 600 rows lack PV or OP" in said(of(pv))
    over_answer = (T < 115) | (T > 200)
    found = of(pv[over_answer], STEP[over_answer], T[over_answer])
    assert found.verdict is not Verdict.TRUSTED
    assert "lies over the answer" in said(found)
    assert found.longest_gap == pytest.approx(87)


@pytest.mark.parametrize(
    ("hidden", "verdict", "words"),
    [
        ((80, 101), Verdict.CARE, "OP moved somewhere within a gap of 23 s"),
        ((50, 101), Verdict.REFUSED, "OP moved somewhere within a gap of 53 s"),
        ((80, 140), Verdict.REFUSED, "PV had already answered"),
    ],
)
def test_a_move_in_a_gap_leaves_the_dead_time_open(
    hidden: tuple[float, float], verdict: Verdict, words: str
) -> None:
    first, last = hidden
    shown = (first > T) | (last < T)
    found = of(answer(STEP)[shown], STEP[shown], T[shown])
    assert found.verdict is verdict
    assert words in said(found)


def test_a_process_faster_than_the_samples_is_used_with_care() -> None:
    found = of(answer(STEP, process=(2, 1.5, 5.3), noise=0.05))
    assert found.verdict is Verdict.CARE
    assert "coarse for a time constant" in said(found)


def test_no_visible_dead_time_is_used_with_care() -> None:
    found = of(answer(STEP, process=(2, 60, 0)))
    assert found.verdict is Verdict.CARE
    assert "No dead time beyond one sample" in said(found)


def test_a_vague_dead_time_is_used_with_care() -> None:
    found = of(answer(STEP, process=(2, 60, 4), noise=2))
    assert found.verdict is Verdict.CARE
    assert "more than +50 %" in said(found)


def test_gains_that_differ_between_steps_are_told() -> None:
    op = output((100, 50), (300, 60))
    pv = answer(output((100, 50), (300, 55)), noise=0.1)
    found = of(pv, op)
    assert found.verdict is not Verdict.TRUSTED
    assert "not the same for all steps" in said(found)


def closed_loop(sp_moves: bool, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    sp = np.where(T > 100, 25.0, 20.0) if sp_moves else np.full(T.size, 20.0)
    waiting, x, integral, pv, op = [40.0] * 13, 0.0, 0.0, [], []
    upset = lfilter([0.2], [1, -0.98], rng.normal(size=T.size))
    for k in range(T.size):
        x += (waiting.pop(0) - 40 - x) / 60
        pv.append(20 + 2 * x + upset[k])
        error = sp[k] - pv[-1]
        integral += 0.5 * error / 60
        op.append(40 + 0.5 * error + integral)
        waiting.append(op[-1])
    return np.array(pv), np.array(op), sp


def test_a_controller_at_work_is_refused_by_its_mode_or_by_its_law() -> None:
    pv, op, sp = closed_loop(sp_moves=True)
    assert_refused(of(pv, op, mode=np.full(600, Mode.AUTO)), "in automatic in 600 of 600 rows")
    assert_refused(of(pv, op, sp=sp), "OP follows PV like a controller")
    pv, op, _ = closed_loop(sp_moves=False)
    assert_refused(of(pv, op), "OP follows PV like a controller")


def test_only_the_stretch_in_manual_is_used() -> None:
    mode = np.full(600, Mode.MAN)
    mode[:60] = Mode.AUTO
    mode[500:] = Mode.CAS
    op = STEP.copy()
    op[:60] += np.linspace(-5, 0, 60)
    found = of(answer(STEP), op, mode=mode)
    assert found.verdict is Verdict.TRUSTED
    assert found.samples == 440
    assert "440 of 600 rows are used, those in manual from 60 s to 499 s" in said(found)
    unknown = of(answer(STEP), mode=np.full(600, Mode.UNKNOWN))
    assert unknown.samples == 600


def test_a_stated_output_before_does_not_count_for_a_stretch_that_begins_later() -> None:
    mode = np.full(600, Mode.MAN)
    mode[:60] = Mode.AUTO
    assert len(of(answer(STEP), mode=mode, op_before=10.0).steps) == 1


def test_a_mode_that_hides_the_move_is_refused() -> None:
    mode = np.full(600, Mode.MAN)
    mode[90:200] = Mode.AUTO
    assert_refused(of(answer(STEP), mode=mode), "did not move in manual")
    mode[:] = Mode.AUTO
    mode[95:103] = Mode.MAN
    assert_refused(of(answer(STEP), mode=mode), "Only 8 samples in manual")


def test_a_manual_stretch_without_outputs_is_not_the_one() -> None:
    mode = np.full(600, Mode.MAN)
    mode[20:50] = Mode.AUTO
    op = STEP.copy()
    op[:20] = np.nan
    assert of(answer(STEP), op, mode=mode).verdict is Verdict.TRUSTED


def test_a_long_record_is_averaged_and_says_so() -> None:
    t = np.arange(120_000.0) / 100
    op = output((100, 50), (700, 43), t=t)
    found = of(answer(op, t=t), op, t)
    assert found.verdict is Verdict.TRUSTED
    assert found.t is not None
    assert found.t.size <= 20_000
    assert found.samples == 120_000
    assert "120000 samples are averaged" in said(found)
    assert model(found)[1] == pytest.approx(TAU, rel=0.01)


def test_a_test_signal_of_many_moves_is_fitted() -> None:
    rng = np.random.default_rng(0)
    t = np.arange(3000.0)
    op = np.repeat(rng.choice([40.0, 50.0], 100), 30)
    found = of(answer(op, t=t), op, t)
    assert found.verdict is not Verdict.REFUSED
    assert found.gains is None
    assert model(found)[1] == pytest.approx(TAU, rel=0.03)


def test_an_output_that_moves_more_often_than_is_bearable_is_averaged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("identification.experiment.MOST_MOVES", 100)
    rng = np.random.default_rng(0)
    t = np.arange(1200.0)
    op = np.repeat(rng.choice([40.0, 50.0], 240), 5)
    found = of(answer(op, t=t, noise=0.05), op, t)
    assert "averaged over 100 equal stretches" in said(found)
    assert model(found)[0] == pytest.approx(K, rel=0.2)


@settings(max_examples=12, deadline=None)
@given(
    speed=st.sampled_from([1 / 60, 3600.0]),
    span=st.sampled_from([0.01, -40.0]),
    offset=st.sampled_from([0.0, 1e4]),
)
def test_units_change_neither_verdict_nor_anything_but_numbers(
    speed: float, span: float, offset: float
) -> None:
    op = output((100, 50), (350, 45))
    pv = answer(op)
    one, other = of(pv, op), of(pv * span + offset, op, T * speed)
    assert other.verdict is one.verdict
    assert len(other.reasons) == len(one.reasons)
    assert isinstance(one.process, FOPDT)
    assert isinstance(other.process, FOPDT)
    assert other.process.tau == pytest.approx(one.process.tau * speed, rel=1e-4)
    assert other.process.theta == pytest.approx(one.process.theta * speed, rel=1e-4)
    np.testing.assert_allclose(other.process.K, one.process.K * span, rtol=1e-4)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_nothing_raises_and_every_verdict_has_its_reasons(data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 60))
    number = st.one_of(
        st.just(float("nan")),
        st.sampled_from([0.0, 1.0, 50.0, 1e-300, -1e13]),
        st.floats(-1e3, 1e3),
    )
    signal = st.lists(number, min_size=n, max_size=n)
    steps = st.lists(st.floats(1e-3, 1e3), min_size=n, max_size=n)
    record = Record(
        t=np.cumsum(data.draw(steps)),
        pv=data.draw(signal),
        op=data.draw(signal),
        op_before=data.draw(st.sampled_from([None, 0.0, 50.0])),
        start=datetime(2026, 1, 1, tzinfo=UTC),
    )
    found = identify(record)
    assert found.reasons
    assert "nan" not in said(found).lower()
    assert (found.process is None) == (found.verdict is Verdict.REFUSED)
