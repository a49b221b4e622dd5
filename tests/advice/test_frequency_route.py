"""Frequency tests through the walk from a record to settings, and what is no frequency test."""

import json

import numpy as np
import pytest

from advice.case_body import case_body
from advice.report.frequency_figures import frequency_sections
from advice.report.page import report_page
from advice.tune import TuningCase, tune
from identification.frequency_test import judge_measured, looks_like_frequency_test
from identification.verdict import Verdict
from loop.controller import PID
from loop.margins import margins
from loop.open_loop import process_output
from loop.process import FOPDT
from loop.record import Mode, Record
from loop.signals import Real
from loop.simulation import simulate

T = np.arange(900.0)
TRUTH = FOPDT(K=2.0, tau=20.0, theta=5.0)
CHIRP = 5 * np.sin(2 * np.pi * (0.003 * T + (0.06 - 0.003) / T[-1] * T**2 / 2))
SINES = 5 * np.concatenate([np.sin(w * T[:300]) for w in (0.0419, 0.126, 0.335)])
WAVES = np.sum(
    [np.sin(2 * np.pi / 450 * k * T - np.pi * k * (k - 1) / 20) for k in range(1, 21)], axis=0
)
TESTS = {"chirp": CHIRP, "sine steps": SINES, "multisine": 5 * WAVES / np.max(np.abs(WAVES))}


def record(op: Real, mode: Mode | None = None) -> Record:
    pv = 80 + process_output(TRUTH, T, op) + np.random.default_rng(0).normal(0, 0.1, T.size)
    modes = None if mode is None else np.full(T.size, mode, dtype=np.int8)
    return Record(t=T, pv=pv, op=40 + op, mode=modes)


@pytest.fixture(scope="module")
def tuned() -> dict[str, TuningCase]:
    return {name: tune(record(op)) for name, op in TESTS.items()}


@pytest.mark.parametrize("name", TESTS)
def test_a_frequency_test_is_tuned_and_held_to_its_measured_response(
    tuned: dict[str, TuningCase], name: str
) -> None:
    case = tuned[name]
    assert case.model is not None
    assert case.model.verdict is Verdict.TRUSTED, case.model.reasons
    assert isinstance(case.process, FOPDT)
    assert case.process.theta == pytest.approx(5.0, abs=0.3)
    assert any("measured frequency response" in reason for reason in case.model.reasons)
    assert case.frequency is not None
    assert case.best is not None
    assert case.best.proposal.pid is not None
    true = margins(TRUTH, case.best.proposal.pid)
    measured = case.frequency.margins
    assert measured is not None
    for margin, value in (("gain", true.gain), ("phase", true.phase)):
        interval = getattr(measured, margin)
        if interval is not None:  # a crossover outside what was measured is not made up
            assert interval[1] * 0.93 < value < interval[2] * 1.07


def test_the_document_and_the_report_carry_the_measured_response(
    tuned: dict[str, TuningCase],
) -> None:
    case = tuned["multisine"]
    body = case_body(case)
    assert json.loads(json.dumps(body, allow_nan=False)) == body
    stated = body["frequency"]
    assert isinstance(stated, dict)
    assert stated["response"]
    assert stated["margins"]
    (section,) = frequency_sections(case)
    assert "Margins without a model" in str(section)
    assert all(name in str(section) for name in ("'measured'", "'95 % band'", "'model'"))
    assert "Measured frequency response" in report_page(case, title="TIC-1")


def test_steps_square_waves_noise_and_loops_are_no_frequency_tests() -> None:
    steps = np.where(T < 200, 0.0, 5.0)
    square = 5 * np.sign(np.sin(0.05 * T))
    noise = np.random.default_rng(1).normal(0, 2, T.size)
    ramps = np.interp(T, [0, 100, 300, 400, 600, 700, 900], [0, 0, 5, 5, -5, -5, 0.0])
    one_line = 5 * np.sin(0.06 * T)
    for op in (steps, square, noise, ramps, one_line):
        assert not looks_like_frequency_test(record(np.asarray(op)))
    assert looks_like_frequency_test(record(CHIRP))
    assert not looks_like_frequency_test(record(CHIRP, Mode.AUTO))
    whole = record(CHIRP)
    gap = Record(t=T, pv=np.where(T == 300, np.nan, whole.pv), op=whole.op)
    assert not looks_like_frequency_test(gap)
    loop = simulate(TRUTH, PID(Kc=1.4, Ti=20.0), t_end=900, dt=1.0, sp=1.0)
    assert not looks_like_frequency_test(Record(t=loop.t, pv=loop.pv, op=loop.op))


def test_a_model_that_misses_the_measured_points_loses_its_trust(
    tuned: dict[str, TuningCase],
) -> None:
    case = tuned["chirp"]
    assert case.frequency is not None
    response = case.frequency.response
    assert judge_measured(response, TRUTH).verdict is Verdict.TRUSTED
    late, strong = FOPDT(K=2.0, tau=20.0, theta=8.0), FOPDT(K=5.0, tau=20.0, theta=5.0)
    assert judge_measured(response, late).verdict is not Verdict.TRUSTED
    assert judge_measured(response, strong).verdict is Verdict.REFUSED
