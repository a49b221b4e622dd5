"""Transfer entropy: what the past of one loop tells of another, whatever the shape of the link."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import digamma, ndtri

from loop.signals import Real
from monitoring.phase_locking import moving

# Lags that are looked at, as in the regressions of `monitoring.granger`, and the most of the
# effect's own that the nearest neighbours see: in more dimensions all neighbours are far.
MOST_LAGS = 12
MOST_MEMORY = 3
# Neighbours: more of them spread less and blur more. The method's page has both, measured.
NEIGHBOURS = 20
# Rows that neighbours are looked for among, spread evenly over the record: bounds the time.
ROWS = 1000
FEWEST_ROWS = 200
ROWS_A_COEFFICIENT = 10
# Signals that are allowed for: each takes a dimension.
MOST_GIVEN = 2
# Cells of equal counts a side, in which the delay of the cause is looked for.
CELLS = 6
SHIFTS = 39
# Beyond every shifted cause, and beyond their mean by so many standard deviations.
BEYOND = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferEntropy:
    """What the past of a cause tells of the next value of an effect, beyond the effect's own past.

    Attributes
    ----------
    value : float or None
        Estimate, at the delay that tells most; near zero, or a little below, where there is
        nothing. [nat]
    by_chance : float or None
        Its mean over causes shifted in time. [nat]
    p_value : float or None
        (1 + shifted causes that reach the value) / (1 + shifted causes). [-]
    beyond : float or None
        Standard deviations by which the value exceeds `by_chance`. [-]
    significant : bool
        The value exceeds every shifted cause, and their mean by three standard deviations.
    delay : int or None
        Delay of the cause. [samples]
    memory : tuple of int
        Lags of the effect that its neighbours are looked for in. [samples]
    reason : str
        Why there is no value; empty otherwise.
    """

    value: float | None = None
    by_chance: float | None = None
    p_value: float | None = None
    beyond: float | None = None
    significant: bool = False
    delay: int | None = None
    memory: tuple[int, ...] = ()
    reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Known:
    """What is known of the effect without the cause.

    Attributes
    ----------
    basis : ndarray, shape (n, c)
        Orthonormal columns of a constant and of the whole past that is allowed for.
    news : ndarray, shape (n,)
        What they leave of the effect, unit size.
    past : ndarray, shape (n, d)
        The chosen part of the past, as neighbours see it.
    memory : tuple of int
        Lags of the effect in it. [samples]
    """

    basis: Real
    news: Real
    past: Real
    memory: tuple[int, ...]

    def left_of(self, columns: Real) -> Real:
        """Free columns, shape (n, m), of what the past tells in straight lines; unit size."""
        left = columns - self.basis @ (self.basis.T @ columns)
        size = np.std(left, axis=0)
        return np.asarray(left / np.where(size > 0, size, 1.0))


def transfer_entropy(
    cause: Real,
    effect: Real,
    *,
    given: Sequence[Real] = (),
    most_lags: int = MOST_LAGS,
    seed: int = 0,
) -> TransferEntropy:
    """Measure the transfer entropy from one signal to another [1]_.

        T = I(y_t; x_{t-u} | past of y)

    the information that the value of x, u samples ago, holds on y, beyond y's past; with `given`,
    beyond the pasts of these too. Estimated by nearest neighbours [2]_ [3]_,

        T = psi(k) + mean(psi(n_z) - psi(n_xz) - psi(n_yz))

    n counting, in the spaces of the past z alone, with x and with y, the points nearer than the
    k-th neighbour in the space of all.

    Signals are replaced by normal scores of their ranks, which changes no information, so that
    monotone scales change nothing. What the whole past (`most_lags`) tells in straight lines is
    then taken out of x and y: given the past, it holds no information, and what is left depends on
    the past as little as can be, where neighbours are most exact. The neighbours see the lags of y
    that an autoregression takes first (at most 3), of x the delay that tells most, and of every
    given signal the one that tells most.

    The cause is shifted around a circle by 39 random times; each shifted cause keeps its dynamics
    and takes the delay that suits it best.

    Parameters
    ----------
    cause, effect : ndarray, shape (n,)
        Signals at the same instants, without gaps, about 20 samples a cycle.
    given : sequence of ndarray, shape (n,)
        Signals that may drive both; at most 2.
    most_lags : int
        Longest delay, and memory. [samples]
    seed : int
        Seed of the shifts, and of the order of equal values.

    Raises
    ------
    ValueError
        The signals are not rows of finite numbers of one length, or more than 2 are given.

    References
    ----------
    .. [1] T. Schreiber, "Measuring information transfer", Physical Review Letters 85 (2000);
       definition from memory, delay of the cause as in later work.
    .. [2] A. Kraskov, H. Stoegbauer and P. Grassberger, "Estimating mutual information", Physical
       Review E 69 (2004); from memory.
    .. [3] S. Frenzel and B. Pompe, "Partial mutual information for coupling analysis of
       multivariate time series", Physical Review Letters 99 (2007); from memory.
    """
    signals = _checked(cause, effect, given)
    moves = moving(signals)
    if not np.all(moves):
        return TransferEntropy(reason=f"signal {int(np.argmin(moves)) + 1} does not move")
    n = signals.shape[1] - most_lags
    fewest = max(FEWEST_ROWS, ROWS_A_COEFFICIENT * (1 + most_lags * (1 + len(given))))
    if n < fewest:
        return TransferEntropy(
            reason=f"{signals.shape[1]} samples are fewer than {fewest + most_lags}"
        )
    rng = np.random.default_rng(seed)
    x, y, *others = (_normal_scores(row, rng) for row in signals)
    known = _known(y, others, most_lags)
    keep = np.unique(np.linspace(0, n - 1, min(ROWS, n)).astype(np.int64))
    neighbours = _Neighbours(known.news[keep], known.past[keep])

    def told(source: Real) -> tuple[float, int]:
        left = known.left_of(_lags(source, range(1, most_lags + 1), most_lags))
        best = _most_telling(left, known.news)
        return neighbours.information(left[keep, best]), best + 1

    value, delay = told(x)
    away = rng.integers(x.size // 10, x.size - x.size // 10, SHIFTS).tolist()
    shifted = np.array([told(np.roll(x, shift))[0] for shift in away])
    by_chance = float(np.mean(shifted))
    beyond = (value - by_chance) / max(float(np.std(shifted, ddof=1)), 1e-12)
    return TransferEntropy(
        value=value,
        by_chance=by_chance,
        p_value=float((1 + np.count_nonzero(shifted >= value)) / (1 + SHIFTS)),
        beyond=beyond,
        significant=bool(value > np.max(shifted) and beyond > BEYOND),
        delay=delay,
        memory=known.memory,
    )


def _checked(cause: Real, effect: Real, given: Sequence[Real]) -> Real:
    rows = [np.asarray(one, dtype=np.float64) for one in (cause, effect, *given)]
    if any(row.ndim != 1 or row.shape != rows[0].shape for row in rows) or not all(
        np.all(np.isfinite(row)) for row in rows
    ):
        raise ValueError("signals must be rows of finite numbers of one length")
    if len(given) > MOST_GIVEN:
        raise ValueError(f"at most {MOST_GIVEN} signals can be allowed for, got {len(given)}")
    return np.array(rows)


def _normal_scores(signal: Real, rng: np.random.Generator) -> Real:
    """Replace values by quantiles of the normal law; equal ones in random order.

    Neighbours at distance zero would count as perfectly known.
    """
    order = np.lexsort((rng.random(signal.size), signal))
    scores = np.empty(signal.size)
    scores[order] = ndtri((np.arange(signal.size) + 0.5) / signal.size)
    return scores


def _lags(signal: Real, lags: Sequence[int], most: int) -> Real:
    """Past values, shape (n - most, len(lags))."""
    return np.column_stack([signal[most - lag : signal.size - lag] for lag in lags])


def _known(effect: Real, others: Sequence[Real], most: int) -> _Known:
    every = range(1, most + 1)
    pasts = [_lags(row, every, most) for row in (effect, *others)]
    n = pasts[0].shape[0]
    basis = np.linalg.qr(np.column_stack([np.ones(n), *pasts]))[0]
    memory = _memory(effect[most:], pasts[0])
    seen = [pasts[0][:, lag - 1] for lag in memory]
    own = np.linalg.qr(np.column_stack([np.ones(n), pasts[0]]))[0]
    alone = effect[most:] - own @ (own.T @ effect[most:])
    for past in pasts[1:]:
        left = past - own @ (own.T @ past)
        seen.append(past[:, _most_telling(left, alone)])
    news = effect[most:] - basis @ (basis.T @ effect[most:])
    return _Known(
        basis=basis,
        news=news / max(float(np.std(news)), 1e-12),
        past=np.column_stack(seen),
        memory=memory,
    )


def _memory(now: Real, past: Real) -> tuple[int, ...]:
    """Lags that an autoregression takes first, by BIC; the first is taken in any case."""
    n = now.size
    lags: list[int] = []
    left, rest = now - np.mean(now), past - np.mean(past, axis=0)
    while len(lags) < MOST_MEMORY:
        size = np.sum(rest**2, axis=0)
        # What a lag shares with those already taken is no longer in it.
        size[[lag - 1 for lag in lags]] = np.inf
        along = (rest.T @ left) ** 2 / np.maximum(size, 1e-9 * n)
        best = int(np.argmax(along))
        # A coefficient is worth ln n of n ln(RSS).
        if lags and -n * np.log1p(-min(along[best] / float(left @ left), 0.999999)) < np.log(n):
            break
        lags.append(best + 1)
        unit = rest[:, best] / np.linalg.norm(rest[:, best])
        left = left - unit * (unit @ left)
        rest = rest - np.outer(unit, unit @ rest)
    return tuple(sorted(lags))


def _most_telling(columns: Real, news: Real) -> int:
    """Place of the column that tells most of the news: mutual information in cells."""
    cells = _cells(columns)
    there = _cells(news[:, None])[:, 0]
    n = news.size
    found = []
    for column in cells.T:
        share = np.bincount(column * CELLS + there, minlength=CELLS * CELLS) / n
        held = share[share > 0]
        # The margins are the same for all columns: entropy of the pairs alone decides.
        found.append(float(held @ np.log(held)))
    return int(np.argmax(found))


def _cells(columns: Real) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """Cut every column into cells of equal counts."""
    n = columns.shape[0]
    cells = np.empty(columns.shape, dtype=np.int64)
    ranks = (np.arange(n) * CELLS // n)[:, None]
    np.put_along_axis(cells, np.argsort(columns, axis=0), np.broadcast_to(ranks, cells.shape), 0)
    return cells


class _Neighbours:
    """Conditional mutual information of one signal after the other with the same news.

    Distances that do not change with the cause are kept.
    """

    def __init__(self, news: Real, past: Real) -> None:
        self.rest = np.column_stack([news, past])
        self.past = _distances(past)
        self.both = np.maximum(self.past, _distances(news[:, None]))

    def information(self, cause: Real) -> float:
        """Estimate I(cause; news | past). [nat]"""
        space = np.column_stack([cause, self.rest])
        reach = cKDTree(space).query(space, k=[NEIGHBOURS + 1], p=np.inf)[0]
        with_cause = np.maximum(self.past, _distances(cause[:, None]))
        counts = [np.count_nonzero(apart < reach, axis=1) for apart in
                  (self.past, with_cause, self.both)]  # fmt: skip
        # Every point is counted in its own surroundings.
        past, caused, seen = (digamma(np.maximum(count, 1)) for count in counts)
        return float(digamma(NEIGHBOURS) + np.mean(past - caused - seen))


def _distances(points: Real) -> Real:
    """Largest coordinate difference of every two points, shape (n, n)."""
    apart = np.abs(points[:, :1] - points[None, :, 0])
    for column in points.T[1:]:
        np.maximum(apart, np.abs(column[:, None] - column[None, :]), out=apart)
    return np.asarray(apart)
