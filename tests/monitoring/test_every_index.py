"""Every index says what it rests on, whatever data it is given."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

from advice.assess import Assessment, assess, assess_signals
from loop.controller import PID
from loop.digital_pid import OutputLimits
from loop.plants import PLANT, routine_operation
from loop.process import FOPDT
from loop.record import Mode, Record
from loop.signals import Real
from monitoring.basis import Basis, Confidence
from monitoring.cause import Cause
from monitoring.indices import ControlIndices, Indices, ModelIndices
from monitoring.known_loop import KnownLoop
from monitoring.scorecard import GradeWord

HEATER = PLANT[3]
KNOWN = KnownLoop(
    process=HEATER.process,
    controller=HEATER.controller,
    limits=OutputLimits(low=0.0, high=100.0),
)
# Indices whose numbers are counts or sums have no choices to state.
WITHOUT_SETTINGS = {"error"}


def results(indices: Indices) -> Iterator[tuple[str, Any]]:
    """Every index of an assessment by its name, those of the model and the control too."""
    for holder in (indices, indices.control, indices.control and indices.control.model):
        if not isinstance(holder, Indices | ControlIndices | ModelIndices):
            continue
        for item in fields(holder):
            index = getattr(holder, item.name)
            if index is not None and not isinstance(index, ControlIndices | ModelIndices):
                yield item.name, index


def whole(record: Record) -> Assessment:
    return assess(record, kind="temperature", pv_range=HEATER.pv_range, known=KNOWN, tau_c=60.0)


@pytest.fixture(scope="module")
def usual() -> Record:
    return routine_operation(HEATER, duration=16_000.0, seed=2)


def numbers(index: object) -> Iterator[float]:
    for item in fields(index):
        value = getattr(index, item.name)
        for one in value if isinstance(value, tuple) else (value,):
            if isinstance(one, float):
                yield one
            elif is_dataclass(one) and not isinstance(one, Basis):
                yield from numbers(one)


def test_every_index_has_settings_share_and_confidence(usual: Record) -> None:
    found = whole(usual)
    assert found.indices is not None
    seen = dict(results(found.indices))
    assert {"best_PI", "mismatch", "expected_response", "desired_settling"} < set(seen)
    assert len(seen) >= 16
    for name, index in seen.items():
        basis = index.basis
        assert isinstance(basis, Basis), name
        assert 0 <= basis.share <= 1, name
        assert basis.settings or name in WITHOUT_SETTINGS, name
        assert all(isinstance(label, str) for label, _ in basis.settings), name
        if basis.refused:
            assert basis.reasons, name
        if basis.confidence is not Confidence.HIGH:
            assert basis.reasons, name
        assert all(np.isfinite(number) for number in numbers(index)), name


def test_below_its_limits_every_index_refuses_in_words(usual: Record) -> None:
    # Sixty samples, twice the fewest that are judged at all: nothing but counts can be said.
    short = usual.between(0.0, 118.0)
    found = whole(short)
    assert found.indices is not None
    refused = {name for name, index in results(found.indices) if index.basis.refused}
    assert {
        "oscillation", "stiction", "minimum_variance", "desired_settling", "load_responses",
        "best_PI", "best_PID", "mismatch", "expected_response",
    } <= refused  # fmt: skip


def _fill(value: float) -> Real:
    return np.full(600, value)


WANDERING = 160 + np.cumsum(np.random.default_rng(0).normal(size=600)) * 0.1
MOVING = 45 + np.random.default_rng(1).normal(size=600)


@pytest.mark.parametrize(
    ("signals", "causes"),
    [
        ({"t": [], "pv": [], "op": []}, {Cause.NOT_ASSESSABLE}),
        ({"pv": _fill(160.0), "op": _fill(45.0)}, {Cause.NOT_ASSESSABLE}),
        ({"pv": _fill(np.nan)}, {Cause.NOT_ASSESSABLE}),
        ({"t": np.r_[5.0, np.arange(599.0)]}, {Cause.NOT_ASSESSABLE}),
        ({"t": np.arange(3.0), "pv": WANDERING[:3], "op": MOVING[:3]}, {Cause.NOT_ASSESSABLE}),
        ({"pv": WANDERING * 100}, {Cause.NOT_ASSESSABLE}),
        ({"mode": np.full(600, Mode.MAN)}, {Cause.NOT_IN_USE}),
        ({"op": _fill(100.0)}, {Cause.CONSTRAINT}),
        ({"op": _fill(-0.2)}, {Cause.CONSTRAINT}),
    ],
    ids=["empty", "constant", "NaN", "unsorted", "three", "unit", "manual", "high", "low"],
)
def test_bad_input_is_answered_with_the_reason(signals: dict[str, Any], causes: set[Cause]) -> None:
    n = len(signals.get("t", np.arange(600.0)))
    given = {"t": np.arange(float(n)), "pv": WANDERING[:n], "op": MOVING[:n]} | signals
    sp = np.full(n, 160.0)
    found = assess_signals(
        **given, sp=sp, kind="temperature", pv_range=HEATER.pv_range, known=KNOWN, tau_c=60.0
    )
    assert found.diagnosis.cause in causes
    assert found.diagnosis.evidence
    if causes == {Cause.NOT_ASSESSABLE}:
        assert found.grade.word is GradeWord.NOT_ASSESSABLE
        assert found.grade.points is None
    else:
        # nothing controls there, so that nothing is said of control by a model either
        assert found.indices is not None
        assert found.indices.control is None


def test_a_sheet_that_no_longer_fits_is_named_as_the_cause(usual: Record) -> None:
    stale = replace(KNOWN, process=FOPDT(K=0.8, tau=120.0, theta=30.0))
    found = assess(usual, kind="temperature", pv_range=HEATER.pv_range, known=stale)
    assert found.diagnosis.cause is Cause.TUNING
    assert "The model does not describe the loop" in found.diagnosis.evidence[0]
    assert "again" in found.diagnosis.action
    calm = replace(KNOWN, controller=PID(Kc=2.5, Ti=60.0))
    other = assess(usual, kind="temperature", pv_range=HEATER.pv_range, known=calm)
    assert any("Set-point moves against" in said for said in other.diagnosis.evidence)
