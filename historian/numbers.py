"""Read numbers as plants write them: decimal comma, thousands, denormals that stand for zero."""

import re
from dataclasses import dataclass

import numpy as np

from loop.signals import Real

SMALLEST = 1.17549435e-38
"""Smallest normal single-precision number: historians store singles, so less stands for zero."""

LARGEST = 3.4028235e38
"""Largest single-precision number: beyond it a cell is no measurement."""

_POINT = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\Z", re.ASCII)
_GROUPS = {
    ",": re.compile(r"[+-]?\d{1,3}(?:,\d{3})+(?:\.\d*)?\Z", re.ASCII),
    ".": re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+(?:,\d*)?\Z", re.ASCII),
    " ": re.compile(r"[+-]?\d{1,3}(?: \d{3})+(?:[.,]\d*)?\Z", re.ASCII),
    "'": re.compile(r"[+-]?\d{1,3}(?:'\d{3})+(?:[.,]\d*)?\Z", re.ASCII),
}
_BLANKS = str.maketrans({"\u00a0": " ", "\u202f": " ", "\u2009": " ", "\u2019": "'", "\u2212": "-"})


@dataclass(frozen=True, slots=True)
class NumberFormat:
    """How numbers are written.

    Attributes
    ----------
    decimal : str
        "." or ",".
    thousands : str
        What groups digits: "" for nothing, else "," "." " " or "'".
    """

    decimal: str = "."
    thousands: str = ""

    def read(self, text: str) -> float | None:
        """Read one cell, None where it is no number in this format.

        >>> NumberFormat(",", ".").read("1.234,5")
        1234.5
        """
        text = text.translate(_BLANKS).strip()
        if self.thousands and _GROUPS[self.thousands].match(text):
            text = text.replace(self.thousands, "")
        if self.decimal == ",":
            if "." in text:
                return None
            text = text.replace(",", ".")
        return float(text) if _POINT.match(text) else None


def looks_numeric(text: str) -> bool:
    """Tell whether a cell is a number in some format."""
    if _POINT.match(text):
        return True
    text = text.translate(_BLANKS).strip()
    return bool(_POINT.match(text.replace(",", ".", 1))) or grouping_of(text) != ""


def grouping_of(text: str) -> str:
    """Find what groups the digits of a number, "" where nothing does."""
    if text[:1] not in "+-0123456789\u2212":
        return ""
    text = text.translate(_BLANKS).strip()
    return next((mark for mark, pattern in _GROUPS.items() if pattern.match(text)), "")


def without_denormals(values: Real) -> tuple[Real, int]:
    """Read numbers too small for single precision as zero.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Numbers as read, NaN for gaps.

    Returns
    -------
    values : ndarray, shape (n,)
        The same array where nothing changes, else a copy.
    zeros : int
        How many numbers became zero.
    """
    size = np.abs(values)
    if not size.size or size.min() >= SMALLEST:
        return values, 0
    small = size < SMALLEST
    zeros = int(np.count_nonzero(small & (values != 0)))
    return (np.where(small, 0.0, values), zeros) if zeros else (values, 0)
