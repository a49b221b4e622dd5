"""Graphical readings: exact on a first-order answer, apart on any other."""

import csv
from pathlib import Path

import numpy as np
import pytest

from identification.step_methods import (
    LEVELS,
    MethodReading,
    spread,
    step_methods,
    two_point_constants,
)
from loop.errors import PoorExcitation

T = np.linspace(0, 600, 6001)
with (Path(__file__).parents[1] / "reference" / "two_point_constants.csv").open() as lines:
    PRINTED = list(csv.DictReader(line for line in lines if not line.startswith("#")))


def read(pv: np.ndarray) -> dict[str, MethodReading]:
    found = step_methods(T, pv, step_at=0.0, op_change=4.0, pv_from=20.0, pv_to=30.0)
    return {reading.method: reading for reading in found}


def first_order(tau: float, theta: float) -> np.ndarray:
    return np.asarray(20 - 10 * np.expm1(-np.maximum(T - theta, 0) / tau))


@pytest.mark.parametrize("row", PRINTED, ids=lambda row: str(row["method"]))
def test_constants_agree_with_the_printed_ones(row: dict[str, str]) -> None:
    levels = LEVELS[row["method"]]
    assert levels == pytest.approx((float(row["p1"]), float(row["p2"])), abs=5e-5)
    found = two_point_constants(*levels)
    for value, printed, published in zip(
        found, (row["a"], row["b"]), (row["published_a"], row["published_b"]), strict=True
    ):
        last_digit = 10.0 ** -len(printed.partition(".")[2])
        assert value == pytest.approx(float(printed), abs=last_digit)
        if published:  # rounded, and by some sources further than their digits
            assert value == pytest.approx(float(published), abs=0.03)


@pytest.mark.parametrize(("tau", "theta"), [(60.0, 12.34), (25.0, 80.0), (50.0, 0.0)])
def test_every_method_is_exact_on_a_first_order_answer(tau: float, theta: float) -> None:
    for name, reading in read(first_order(tau, theta)).items():
        assert reading.process is not None
        # The tangent is read over a stretch, which a curved answer flattens.
        within = 0.15 if name == "tangent" else 1e-3
        np.testing.assert_allclose(reading.process.K, 2.5)
        assert reading.process.tau == pytest.approx(tau, rel=within)
        assert reading.process.theta == pytest.approx(theta, abs=within * tau)


def test_on_two_lags_the_methods_lie_apart() -> None:
    pv = 30 - 10 * (1 + T / 40) * np.exp(-T / 40)
    found = spread(tuple(read(pv).values()))
    assert found is not None
    assert found.tau[1] > 1.5 * found.tau[0]
    assert found.theta[0] < 0.5 * found.theta[1]
    assert found.total[0] < 80 < 1.1 * found.total[1]
    one = spread(tuple(r for n, r in read(first_order(60, 12)).items() if n != "tangent"))
    assert one is not None
    assert one.total[1] < 1.001 * one.total[0]


def test_what_has_no_answer_says_why() -> None:
    over = read(np.where(T > 300, 30.0, 50.0 - 30.0 * (T < 1)))
    assert over["area"].process is None
    assert "area over the answer" in over["area"].remark
    never = read(np.full(T.size, 20.0))
    assert all(reading.process is None for reading in never.values())
    assert "never passes" in never["Smith"].remark
    assert spread(tuple(never.values())) is None
    with pytest.raises(PoorExcitation, match="ends where it began"):
        step_methods(T, first_order(60, 12), step_at=0, op_change=1, pv_from=20, pv_to=20)


def test_a_late_answer_without_room_for_a_tangent_says_so() -> None:
    t = np.array([0.0, 1, 2, 3, 4])
    found = step_methods(
        t, np.array([0.0, 0.1, 0.5, 0.9, 1.0]), step_at=0, op_change=1, pv_from=0, pv_to=1
    )
    tangent = next(reading for reading in found if reading.method == "tangent")
    assert tangent.process is None
    assert "tangent" in tangent.remark
