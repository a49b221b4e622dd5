"""Few points for a plot of many, with the extremes and the gaps still in it.

References
----------
.. [1] J. Van Der Donckt, J. Van Der Donckt, M. Rademaker and S. Van Hoecke, "MinMaxLTTB: leveraging
   MinMax-preselection to scale LTTB," IEEE VIS, 2023. arXiv:2305.00332
"""

import math
from dataclasses import dataclass

import numpy as np
from tsdownsample import MinMaxLTTBDownsampler

from historian.resampling import Series
from historian.sample_rows import Integers
from loop.signals import Flags, Real

HELD_POINTS = 500_000  # points kept while a long signal comes in, 9 MB
FEWEST = 3  # the least the algorithm can choose


def downsample(t: Real, values: Real, n: int, *, max_gap: float | None = None) -> Series:
    """Choose at most n points of a signal that draw the same picture [1]_.

    Parameters
    ----------
    t : ndarray, shape (m,)
        Strictly increasing times. [s]
    values : ndarray, shape (m,)
        Values, NaN where there is none.
    n : int
        Greatest number of points, with those that mark a gap.
    max_gap : float, optional
        Distance of neighbours with a value from which there is a gap between them. Default: there
        is one wherever a sample without a value lies between them. [s]

    Returns
    -------
    Series
        Points of the signal as they are, and one NaN in the middle of every gap between two of
        them. From n = 8 on the first, last, smallest and largest value are among them.

    Raises
    ------
    ValueError
        n is not positive.

    Examples
    --------
    >>> downsample(np.arange(6.0), np.array([1.0, 5.0, 2.0, np.nan, 2.0, 2.0]), 9).values
    array([ 1.,  5.,  2., nan,  2.,  2.])
    """
    picture = Picture(n, max_gap=max_gap)
    picture.add(t, values)
    return picture.series()


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """Points with a value; `cut` tells which lie behind a gap."""

    t: Real
    values: Real
    cut: Flags

    def chosen(self, places: Integers) -> "_Points":
        """Keep some points; a gap that lay between two of them stays between them."""
        gaps = np.cumsum(self.cut)[places]
        cut = np.r_[self.cut[places[:1]], np.diff(gaps) > 0]
        return _Points(self.t[places], self.values[places], cut)


class Picture:
    """Few points of a signal that comes in parts, too long to be held as a whole.

    Parameters
    ----------
    n : int
        Greatest number of points of the result.
    max_gap : float, optional
        As in `downsample`. [s]
    """

    def __init__(self, n: int, *, max_gap: float | None = None) -> None:
        if n < 1:
            raise ValueError(f"a plot needs at least one point, got {n}")
        self._n = n
        self._max_gap = max_gap
        self._held: list[_Points] = []
        self._held_points = 0
        self._last = math.nan
        self._open_gap = False

    def add(self, t: Real, values: Real) -> None:
        """Take the next part of the signal, later than all before it."""
        known = np.flatnonzero(~np.isnan(values))
        if not known.size:
            self._open_gap = self._open_gap or t.size > 0
            return
        times = t[known]
        if self._max_gap is None:
            missing = np.diff(known, prepend=-1) > 1
            missing[0] |= self._open_gap
            self._open_gap = bool(known[-1] < t.size - 1)
        else:
            missing = np.diff(times, prepend=self._last) > self._max_gap
        self._last = float(times[-1])
        self._hold(_Points(times, values[known], missing))
        if self._held_points > HELD_POINTS:
            self._hold(_fewer(self._drop(), HELD_POINTS // 5))

    def _hold(self, points: _Points) -> None:
        self._held.append(points)
        self._held_points += points.t.size

    def _drop(self) -> _Points:
        parts, self._held, self._held_points = self._held, [], 0
        return _Points(
            np.concatenate([np.empty(0), *(part.t for part in parts)]),
            np.concatenate([np.empty(0), *(part.values for part in parts)]),
            np.concatenate([np.empty(0, np.bool_), *(part.cut for part in parts)]),
        )

    def series(self) -> Series:
        """Give the points chosen of all that has come in."""
        points = self._drop()
        self._hold(points)
        gaps = int(np.count_nonzero(points.cut[1:]))
        if points.t.size + gaps > self._n:
            # A gap needs a point on each side: with many gaps half of all points are marks.
            points = _fewer(points, max(self._n - gaps, (self._n + 1) // 2))
        behind = np.flatnonzero(points.cut[1:]) + 1
        middle = points.t[behind - 1] + (points.t[behind] - points.t[behind - 1]) / 2
        return Series(
            t=np.insert(points.t, behind, middle), values=np.insert(points.values, behind, np.nan)
        )


def _fewer(points: _Points, n: int) -> _Points:
    """Choose at most n points: the extremes, both sides of a few gaps, and a fair rest."""
    t, values = points.t, points.values
    chosen = np.zeros(t.size, np.bool_)
    chosen[np.array([values.argmin(), values.argmax(), 0, t.size - 1])[:n]] = True
    behind = np.flatnonzero(points.cut[1:]) + 1
    if 4 * behind.size <= n - 4:
        chosen[behind - 1] = chosen[behind] = True
    rest = n - int(np.count_nonzero(chosen))
    if rest >= FEWEST:
        # scaled, because the areas of triangles between huge values would overflow
        size = float(np.max(np.abs(values))) or 1.0
        chooser = MinMaxLTTBDownsampler()  # type: ignore[no-untyped-call]
        chosen[chooser.downsample(t - t[0], values / size, n_out=rest)] = True
    return points.chosen(np.flatnonzero(chosen))
