"""Tests of any shape in one record, with and without play in the valve: the truth is recovered."""

import json

import numpy as np
import pytest

from advice.facts import model_facts
from advice.model_body import model_body
from advice.tune import tune
from identification.condense import Samples
from identification.dead_band import fit_dead_band, stem_of, tells_dead_band
from identification.held_input import HeldInput
from identification.identify import identify
from identification.least_squares import fopdt_least_squares
from identification.verdict import Verdict
from loop.open_loop import process_output
from loop.process import FOPDT, SOPDT, Process
from loop.record import Record
from loop.signals import Real
from loop.valve import DeadBand, stem_positions

T = np.arange(0.0, 1500.0, 2.5)
TRUTH = FOPDT(K=2.0, tau=40.0, theta=12.3)
NOISE = 0.2  # of an answer of 10


def stairs(*levels: float) -> Real:
    """Levels held equally long."""
    at = (T * len(levels) // (T[-1] + 1)).astype(int)
    held: Real = np.asarray(levels, dtype=np.float64)
    return np.asarray(held[at])


def prbs(seed: int = 4) -> Real:
    """Two levels, switched or not every 50 s."""
    bits = np.random.default_rng(seed).integers(0, 2, 31)
    return np.asarray(np.where(bits[(T // 50).astype(int)], 45.0, 40.0))


def ramped() -> Real:
    """Up over 100 s in many small parts, later down over 60 s."""
    at, levels = [0, 200, 300, 800, 860, 1500], [40.0, 40, 46, 46, 41, 41]
    return np.asarray(np.interp(T, at, levels)).round(2)


SHAPES = {
    "step": np.where(T < 150, 40.0, 45.0),
    "step that does not return, at the end": np.where(T < 1200, 40.0, 45.0),
    "doublet": np.select([T < 150, T < 300, T < 450], [40.0, 45.0, 35.0], 40.0),
    "pulse": np.where((T < 150) | (T > 250), 40.0, 46.0),
    "short pulse": np.where((T < 150) | (T > 180), 40.0, 52.0),
    "staircase": stairs(40, 43, 46, 49, 46, 43, 40),
    "unequal sizes": stairs(40, 44, 42, 47, 41),
    "not returning": stairs(40, 44, 48, 45),
    "PRBS": prbs(),
    "ramped moves": ramped(),
}


def record(op: Real, *, width: float = 0.0, seed: int = 0, process: Process = TRUTH) -> Record:
    stem = stem_positions(DeadBand(width=width), op, position=float(op[0]) + 0.2 * width)
    noise = np.random.default_rng(seed).normal(0, NOISE, T.size)
    return Record(t=T, pv=process_output(process, T, stem, pv0=50.0) + noise, op=op)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_truth_lies_within_four_standard_errors_and_errors_are_small(shape: str) -> None:
    found = identify(record(SHAPES[shape]))
    assert isinstance(found.process, FOPDT)
    assert found.standard_errors is not None
    off = np.array([found.process.K, found.process.tau, found.process.theta]) - [2, 40, 12.3]
    assert np.all(np.abs(off) < 4 * found.standard_errors), found.process
    assert np.all(found.standard_errors < [0.06, 3, 1.5])
    assert found.verdict is Verdict.TRUSTED, found.reasons
    assert found.dead_band is None


@pytest.mark.parametrize("shape", ["doublet", "staircase", "unequal sizes"])
def test_a_dead_band_is_found_with_its_error_and_costs_trust(shape: str) -> None:
    found = identify(record(SHAPES[shape], width=1.0))
    band = found.dead_band
    assert band is not None
    assert abs(band.width - 1.0) < 4 * band.error
    assert band.error < 0.05
    assert isinstance(found.process, FOPDT)
    assert found.standard_errors is not None
    off = np.array([found.process.K, found.process.tau, found.process.theta]) - [2, 40, 12.3]
    assert np.all(np.abs(off) < 4 * found.standard_errors), found.process
    assert found.verdict is Verdict.CARE
    assert any("dead band of" in reason for reason in found.reasons)


def test_the_error_of_a_dead_band_is_calibrated() -> None:
    op = SHAPES["unequal sizes"]
    off = []
    for seed in range(30):
        given = record(op, width=1.0, seed=seed)
        samples = Samples(t=T, pv=given.pv, weight=None)
        band = fit_dead_band(
            samples, fopdt_least_squares(T, given.pv, HeldInput.from_samples(T, op))
        )
        assert band is not None
        off.append((band.width - 1.0) / band.error)
    assert np.max(np.abs(off)) < 4
    assert 0.6 < np.std(off) < 1.4  # 30 values of a unit normal: within .25 of 1, nearly always


def test_a_dead_band_of_half_the_move_is_refused() -> None:
    found = identify(record(SHAPES["staircase"], width=1.8))
    assert found.verdict is Verdict.REFUSED
    assert any("dead band of" in reason for reason in found.reasons)


@pytest.mark.parametrize("shape", ["doublet", "staircase", "unequal sizes", "PRBS"])
def test_two_lags_are_taken_for_no_dead_band(shape: str) -> None:
    two = SOPDT(K=2.0, tau1=40.0, tau2=25.0, theta=12.0)
    assert identify(record(SHAPES[shape], process=two)).dead_band is None


def test_only_unequal_reversals_and_moves_that_go_on_tell_a_dead_band() -> None:
    told = {name: tells_dead_band(HeldInput.from_samples(T, op)) for name, op in SHAPES.items()}
    assert told["staircase"]
    assert told["unequal sizes"]
    assert told["doublet"]
    assert not told["step"]
    assert not told["pulse"]
    assert not told["PRBS"]  # a smaller gain explains it as well


def test_the_position_of_a_held_valve_is_that_of_the_model_of_valves() -> None:
    op = SHAPES["unequal sizes"]
    held = HeldInput.from_samples(T, op)
    stem = stem_of(held, 1.2, 0.25)
    whole = stem_positions(DeadBand(width=1.2), op, position=float(stem.levels[0]))
    at = np.searchsorted(held.instants, T, side="right")
    np.testing.assert_allclose(stem.levels[at], whole, atol=1e-12)


def test_the_dead_band_is_in_the_document_and_among_the_facts() -> None:
    case = tune(record(SHAPES["unequal sizes"], width=1.0))
    assert case.model is not None
    body = model_body(case.model)
    stated = body["dead_band"]
    assert isinstance(stated, dict)
    assert json.loads(json.dumps(body, allow_nan=False)) == body
    assert abs(float(str(stated["width"])) - 1.0) < 0.1
    assert "± " in dict(model_facts(case))["dead band"]
    assert case.best is not None
