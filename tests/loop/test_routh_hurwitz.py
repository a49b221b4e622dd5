import math

import numpy as np
import pytest

from loop.controller import PID
from loop.margins import margins
from loop.process import FOPDT, TransferFunction
from loop.routh_hurwitz import characteristic_polynomial, routh_array
from loop.stability import unstable_poles


def test_the_array_counts_what_the_roots_say_singular_cases_included() -> None:
    # Small whole coefficients vanish often: every third array here needs help.
    rng = np.random.default_rng(3)
    helped = 0
    for _ in range(1000):
        c = rng.integers(-3, 4, rng.integers(2, 9)).astype(float)
        c[0] = c[0] or 1.0
        found = routh_array(c)
        roots = np.roots(c)
        right, axis = int(np.sum(roots.real > 1e-4)), int(np.sum(np.abs(roots.real) <= 1e-4))
        assert (found.right, found.axis) == (right, axis), c
        assert found.stable == (right == axis == 0)
        helped += bool(found.zero_rows or found.zero_pivots)
    assert helped > 250


def test_a_row_of_zeros_means_roots_symmetric_to_the_origin() -> None:
    # (s^2 + 4)(s + 1)(s + 2): the row of s^1 vanishes.
    found = routh_array([1, 3, 6, 12, 8])
    assert (found.right, found.axis, found.zero_rows) == (0, 2, (1,))
    # (s^2 - 1)(s + 2): one root right of the axis among the symmetric pair.
    found = routh_array([1, 2, -1, -2])
    assert (found.right, found.axis) == (1, 0)


def test_decimals_count_as_they_are_written() -> None:
    # s^3 + .1 s^2 + .3 s + .03 = (s^2 + .3)(s + .1); in binary its row only almost vanishes.
    found = routh_array([1, 0.1, 0.3, 0.03])

    assert (found.right, found.axis, found.zero_rows) == (0, 2, (1,))


def test_a_constant_and_a_line() -> None:
    assert routh_array([3]).stable
    assert routh_array([1, 2]).stable
    assert routh_array([1, -2]).right == 1
    assert routh_array([1, 0]).axis == 1
    for bad in ([], [0, 1], [1, math.nan]):
        with pytest.raises(ValueError, match="the first not zero"):
            routh_array(bad)


def test_the_characteristic_polynomial_loses_stability_where_the_margins_say() -> None:
    lags = TransferFunction((1.0,), (1.0, 3.0, 2.0, 0.0))
    limit = margins(lags, PID(Kc=1)).gain
    assert limit == pytest.approx(6.0)
    for factor, right in ((0.99, 0), (1.01, 2)):
        found = routh_array(characteristic_polynomial(lags, PID(Kc=factor * limit)))
        assert (found.right, found.stable) == (right, right == 0)


def test_a_dead_time_needs_a_stated_pade_order_and_a_high_one_agrees_with_the_exact_count() -> None:
    heater = FOPDT(K=2, tau=120, theta=30)
    with pytest.raises(ValueError, match="a dead time of 30 s needs a pade_order within 1 and 12"):
        characteristic_polynomial(heater, PID(Kc=1))
    for Kc in (0.45, 3.4, 3.6):
        found = routh_array(characteristic_polynomial(heater, PID(Kc=Kc), pade_order=6))
        assert found.right == unstable_poles(heater, PID(Kc=Kc))
    # Order 1 is no judge: it lets through a gain that oscillates.
    lost = PID(Kc=3.9)
    assert routh_array(characteristic_polynomial(heater, lost, pade_order=1)).stable
    assert unstable_poles(heater, lost) == 2
