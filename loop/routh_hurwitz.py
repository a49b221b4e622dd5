"""Routh's array of a polynomial, in exact arithmetic, with its two singular cases.

A dead time has no polynomial: `loop.stability` decides such a loop exactly, and here it takes a
Padé approximation, which must be stated beside the answer.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

import numpy as np

from loop.controller import PID
from loop.lti import HIGHEST_PADE
from loop.process import Polynomial, Process


@dataclass(frozen=True, slots=True, kw_only=True)
class RouthArray:
    """Routh's array and what it says.

    Attributes
    ----------
    rows : tuple of tuple of float
        The array, highest power first. A row that needed help stands in its replaced form.
    right : int
        Roots in the open right half-plane.
    axis : int
        Roots on the imaginary axis.
    zero_rows, zero_pivots : tuple of int
        Powers of s whose row vanished, and those whose row began with zero.
    """

    rows: tuple[tuple[float, ...], ...]
    right: int
    axis: int
    zero_rows: tuple[int, ...]
    zero_pivots: tuple[int, ...]

    @property
    def stable(self) -> bool:
        """Whether every root lies in the open left half-plane."""
        return self.right == 0 and self.axis == 0


def routh_array(coefficients: Sequence[float]) -> RouthArray:
    """Count the roots of a polynomial in the right half-plane without solving it [1]_.

    r[i][j] = (r[i-1][0] r[i-2][j+1] - r[i-2][0] r[i-1][j+1]) / r[i-1][0]

    A row that vanishes is replaced by the derivative of the polynomial of the row above, whose
    roots lie symmetrically to the origin. A row that only begins with p zeros gets itself added,
    moved p places to the left and times (-1)^p [2]_. Coefficients count as the decimals they are
    written with, so 0.1 is one tenth and a zero is a zero.

    Parameters
    ----------
    coefficients : sequence of float
        Real coefficients, highest power first, the first not zero.

    Raises
    ------
    ValueError
        There are no coefficients, the first is zero, or one is not finite.

    References
    ----------
    .. [1] E. J. Routh, "A Treatise on the Stability of a Given State of Motion", 1877.
    .. [2] M. Benidir, B. Picinbono, "Extended table for eliminating the singularities in Routh's
       array", IEEE Trans. Automatic Control 35 (1990) 218-222 (from memory; the counts are checked
       against the roots).

    Examples
    --------
    >>> routh_array([1, 2, 3, 4, 5]).right
    2
    >>> routh_array([1, 2, 2, 4]).axis
    2
    """
    a = _exact(coefficients)
    degree = len(a) - 1
    rows = [list(a[0::2])]
    if degree:
        odd = list(a[1::2])
        rows.append(odd + [Fraction(0)] * (len(rows[0]) - len(odd)))
    zero_rows: list[int] = []
    zero_pivots: list[int] = []
    for power in range(degree - 1, -1, -1):
        row = rows[-1]
        if not any(row):
            row = _derivative(rows[-2], power + 1)
            zero_rows.append(power)
        elif not row[0]:
            row = _without_zero_pivot(row)
            zero_pivots.append(power)
        rows[-1] = row
        if power:
            rows.append(_next_row(rows[-2], row))
    signs = [row[0] > 0 for row in rows]
    right = sum(before != after for before, after in pairwise(signs))
    axis = 0
    if zero_rows:
        # The polynomial above the first vanished row holds every root on the axis, and as many
        # right of it as left; those right of it are the sign changes from its row on.
        top = zero_rows[0] + 1
        tail = signs[degree - top :]
        axis = top - 2 * sum(before != after for before, after in pairwise(tail))
    return RouthArray(
        rows=tuple(tuple(float(x) for x in row) for row in rows),
        right=right,
        axis=axis,
        zero_rows=tuple(zero_rows),
        zero_pivots=tuple(zero_pivots),
    )


def _exact(coefficients: Sequence[float]) -> list[Fraction]:
    values = [float(c) for c in coefficients]
    if not values or not values[0] or not np.all(np.isfinite(values)):
        raise ValueError(
            f"a polynomial needs finite coefficients, the first not zero, got {list(coefficients)}"
        )
    return [Fraction(repr(value)) for value in values]


def _next_row(above: list[Fraction], row: list[Fraction]) -> list[Fraction]:
    pairs = zip([*above[1:], Fraction(0)], [*row[1:], Fraction(0)], strict=True)
    return [left - above[0] * right / row[0] for left, right in pairs]


def _derivative(row: list[Fraction], power: int) -> list[Fraction]:
    """Coefficients of the derivative of sum row[j] s^(power - 2 j)."""
    return [c * max(power - 2 * j, 0) for j, c in enumerate(row)]


def _without_zero_pivot(row: list[Fraction]) -> list[Fraction]:
    zeros = next(j for j, c in enumerate(row) if c)
    moved = row[zeros:] + [Fraction(0)] * zeros
    return [c + (-1) ** zeros * m for c, m in zip(row, moved, strict=True)]


def characteristic_polynomial(
    process: Process, controller: PID, *, pade_order: int | None = None
) -> Polynomial:
    """Multiply out d(s) + n(s) of a loop; a dead time goes in as a Padé approximation.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    pade_order : int, optional
        Order of the approximation, 1 to 12; needed if, and only if, there is dead time. [-]

    Raises
    ------
    ValueError
        The order is missing, or lies outside 1 to 12.
    """
    n = np.polymul(process.numerator, controller.numerator) * controller.action.sign
    d = np.polymul(process.denominator, controller.denominator)
    if process.theta:
        if pade_order is None or not 1 <= pade_order <= HIGHEST_PADE:
            raise ValueError(
                f"a dead time of {process.theta:g} s needs a pade_order within 1 and "
                f"{HIGHEST_PADE}, got {pade_order}"
            )
        top, bottom = _pade(process.theta, pade_order)
        n, d = np.polymul(n, top), np.polymul(d, bottom)
    return tuple(float(c) for c in np.trim_zeros(np.polyadd(d, n), "f"))


def _pade(theta: float, order: int) -> tuple[Polynomial, Polynomial]:
    """Coefficients of the diagonal Padé approximation of e^(-theta s), highest power first."""
    c = [1.0]
    for k in range(1, order + 1):
        c.append(c[-1] * (order - k + 1) / (k * (2 * order - k + 1)) * theta)
    top = tuple((-1) ** k * c[k] for k in range(order, -1, -1))
    return top, tuple(reversed(c))
