"""What was done to the readings is seen, and costs the model its trust."""

import numpy as np
import pytest

from identification.data_honesty import data_facts, judge_data, judge_unit, resolution
from identification.held_input import HeldInput, lag_response
from identification.identify import Identification, identify
from identification.verdict import Verdict
from loop.process import FOPDT
from loop.record import Record

T = np.arange(0.0, 601.0)
OP = np.where(T < 100, 40.0, 50.0)
TRUE = 20 + 2 * lag_response(HeldInput.from_samples(T, OP), T, 60.0, 12.4)[0]
RAW = TRUE + np.random.default_rng(0).normal(0, 0.2, T.size)


def of(pv: np.ndarray, unit: str = "") -> Identification:
    return identify(Record(t=T, pv=pv, op=OP, pv_unit=unit))


def said(found: Identification) -> str:
    return " ".join(found.reasons)


def drawn_between(every: int) -> np.ndarray:
    """Keep one reading in so many and draw straight lines, as an interpolated export does."""
    return np.asarray(np.interp(T, T[::every], RAW[::every]))


def logged_by_exception(dead_band: float) -> np.ndarray:
    held = [RAW[0]]
    for value in RAW[1:].tolist():
        held.append(value if abs(value - held[-1]) > dead_band else held[-1])
    return np.array(held)


def test_raw_readings_are_left_alone() -> None:
    found = of(RAW)
    assert found.verdict is Verdict.TRUSTED
    facts = data_facts(T, RAW)
    assert (facts.resolution, facts.repeated, facts.drawn) == (0, 0, 0)
    assert (facts.longest_equal, facts.longest_line) == (0, 0)


@pytest.mark.parametrize(("every", "verdict"), [(10, Verdict.CARE), (60, Verdict.REFUSED)])
def test_lines_drawn_between_few_readings_cost_trust(every: int, verdict: Verdict) -> None:
    found = of(drawn_between(every))
    assert found.verdict is verdict
    assert "straight lines" in said(found)
    facts = data_facts(T, drawn_between(every))
    assert facts.drawn == pytest.approx(1 - 1 / every, abs=0.02)
    assert facts.longest_line == pytest.approx(every, abs=2)


@pytest.mark.parametrize(
    ("dead_band", "verdict"),
    [(0.3, Verdict.TRUSTED), (5.0, Verdict.CARE), (9.0, Verdict.REFUSED)],
)
def test_a_wide_dead_band_of_the_log_costs_trust(dead_band: float, verdict: Verdict) -> None:
    found = of(logged_by_exception(dead_band))
    assert found.verdict is verdict
    assert ("repeats one value" in said(found)) is (verdict is not Verdict.TRUSTED)


def test_a_transmitter_that_freezes_during_the_answer_is_seen() -> None:
    pv = RAW.copy()
    pv[120:160] = pv[120]
    found = of(pv)
    assert found.verdict is not Verdict.TRUSTED
    assert "repeats one value from 120 s to 159 s" in said(found)


@pytest.mark.parametrize(
    ("digits", "verdict"),
    [(0.5, Verdict.TRUSTED), (3.0, Verdict.CARE), (6.0, Verdict.REFUSED)],
)
def test_coarse_rounding_costs_trust(digits: float, verdict: Verdict) -> None:
    clean = np.round(TRUE / digits) * digits
    assert resolution(clean) == pytest.approx(digits)
    found = of(clean)
    assert found.verdict is verdict


def test_noise_averages_a_resolution_of_its_own_size_out() -> None:
    found = of(np.round(RAW / 0.4) * 0.4)
    assert found.verdict is Verdict.TRUSTED
    assert isinstance(found.process, FOPDT)
    assert pytest.approx(2, rel=0.02) == found.process.K


def test_a_simulated_record_without_noise_is_not_called_compressed() -> None:
    assert of(TRUE).verdict is Verdict.TRUSTED
    ramp = np.clip(T - 100, 0, 300)
    assert judge_data(T, ramp, ramp, swing=300.0, slowness=50.0, noise_sd=0.0) == []


@pytest.mark.parametrize(
    ("factor", "offset", "words"),
    [(1.0, 273.15, "Celsius to kelvin"), (1.8, 32.0, "Celsius to Fahrenheit")],
)
def test_a_unit_that_changes_within_the_record_refuses_it(
    factor: float, offset: float, words: str
) -> None:
    pv = np.where(T < 300, RAW, RAW * factor + offset)
    assert words in said(of(pv))
    assert of(pv).verdict is Verdict.REFUSED
    back = np.where(T < 300, RAW * factor + offset, RAW)
    first, last = words.split(" to ")
    assert f"{last} to {first}" in said(of(back))
    assert of(back).verdict is Verdict.REFUSED


def test_a_stated_unit_that_the_readings_do_not_have_is_never_trusted() -> None:
    kelvin = of(RAW + 273.15, "degC")
    assert kelvin.verdict is Verdict.CARE
    assert "looks like kelvin" in said(kelvin)
    assert of(RAW, "°C").verdict is Verdict.TRUSTED
    assert of(RAW + 273.15, "K").verdict is Verdict.TRUSTED
    (celsius,) = judge_unit(RAW, "K")
    assert "Celsius or Fahrenheit" in celsius.reason
    (impossible,) = judge_unit(RAW - 500, "C")
    assert "no temperature" in impossible.reason
