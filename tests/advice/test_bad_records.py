"""Records that no model may be trusted on: never a failure, never `trusted`, always a reason."""

import numpy as np
import pytest

from advice.tune import tune
from identification.verdict import Verdict
from loop.open_loop import process_output
from loop.process import FOPDT
from loop.record import Record
from loop.signals import Real

T = np.arange(0.0, 900.0, 3.0)
OP = np.where(T < 150, 40.0, 46.0)
PV = 50 + process_output(FOPDT(K=2.0, tau=60.0, theta=15.0), T, OP - 40)
PV = PV + np.random.default_rng(0).normal(0, 0.05, T.size)
HALF = T > 450

BAD: dict[str, tuple[Real, Real, Real]] = {
    "no reading of PV": (T, np.full(T.size, np.nan), OP),
    "no reading of OP": (T, PV, np.full(T.size, np.nan)),
    "every other reading, never both": (
        T, np.where(T % 2 == 0, PV, np.nan), np.where(T % 2 == 0, np.nan, OP),
    ),
    "constant PV": (T, np.full(T.size, 50.0), OP),
    "constant OP": (T, PV, np.full(T.size, 40.0)),
    "all constant": (T, np.full(T.size, 50.0), np.full(T.size, 40.0)),
    "one sample": (T[:1], PV[:1], OP[:1]),
    "two samples": (T[:2], PV[[0, -1]], OP[[0, -1]]),
    "saturated from the start": (T, np.full(T.size, 100.0), OP),
    "saturated at half of the answer": (T, np.minimum(PV, 56.0), OP),
    "kelvin from the middle on": (T, np.where(HALF, PV + 273.15, PV), OP),
    "Fahrenheit from the middle on": (T, np.where(HALF, 1.8 * PV + 32, PV), OP),
    "noise alone": (T, np.random.default_rng(1).normal(50, 1, T.size), OP),
    "PV before OP": (T, np.roll(PV, -25), OP),
    "PV shuffled": (T, np.random.default_rng(2).permutation(PV), OP),
    "beyond any transmitter": (T, PV * 1e14, OP),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_bad_record_is_answered_with_reasons_and_never_trusted(name: str) -> None:
    t, pv, op = BAD[name]
    case = tune(Record(t=t, pv=pv, op=op))
    assert case.recommended_reason
    assert case.model is not None
    assert case.model.verdict is not Verdict.TRUSTED, case.model.reasons
    assert case.model.reasons
    assert "nan" not in " ".join(case.model.reasons).lower()


def test_kelvin_in_a_column_that_says_celsius_is_not_trusted() -> None:
    case = tune(Record(t=T, pv=PV + 273.15, op=OP, pv_unit="degC"))
    assert case.model is not None
    assert case.model.verdict is Verdict.CARE
    assert any("kelvin" in reason for reason in case.model.reasons)


def test_times_that_do_not_increase_are_no_record() -> None:
    order = np.random.default_rng(3).permutation(T.size)
    with pytest.raises(ValueError, match="increas"):
        Record(t=T[order], pv=PV[order], op=OP[order])
    with pytest.raises(ValueError, match="increas"):
        Record(t=np.zeros(T.size), pv=PV, op=OP)


def test_the_same_record_without_the_fault_is_trusted() -> None:
    case = tune(Record(t=T, pv=PV, op=OP))
    assert case.model is not None
    assert case.model.verdict is Verdict.TRUSTED
