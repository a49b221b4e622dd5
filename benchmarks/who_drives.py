"""Who drives whom of two signals: Granger beside statsmodels, and transfer entropy beside both.

Everything follows from a seed.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from scipy.signal import lfilter
from statsmodels.tsa.stattools import grangercausalitytests

from benchmarks.section import Section, Target
from benchmarks.timing import duration, interleaved
from loop.signals import Real
from monitoring.granger import Granger, granger
from monitoring.transfer_entropy import TransferEntropy, transfer_entropy

SEED, COUNT, SAMPLES = 21, 20, 1500
# Samples and lag of the pairs that are timed, pairs that share nothing and their samples.
TIMED, PERIOD = 4000, 20
INDEPENDENT, SHORT = 200, 400
COLUMNS = (
    "the first drives the second", "Granger", "transfer entropy", "Granger, backwards",
    "transfer entropy, backwards",
)  # fmt: skip
Pair: TypeAlias = tuple[Real, Real]
Draw: TypeAlias = Callable[[np.random.Generator, int], Pair]


def _late(x: Real, e: Real, *, lag: float = 0.7) -> Real:
    """Put x through a lag and two samples of delay."""
    return np.asarray(lfilter([1 - lag], [1.0, -lag], np.roll(x, 2)) + e)


def resonance(rng: np.random.Generator, n: int) -> Real:
    """Make a linear loop that swings with a period of 20 samples.

    Parameters
    ----------
    rng : Generator
        Source of chance.
    n : int
        Samples.
    """
    a = [1.0, -2 * 0.98 * np.cos(2 * np.pi / PERIOD), 0.98**2]
    wave = np.asarray(lfilter([1.0], a, rng.normal(size=n + 500))[500:])
    return wave / float(np.std(wave))


def _noise(rng: np.random.Generator, n: int) -> Pair:
    x = np.asarray(lfilter([1.0], [1.0, -0.6], rng.normal(size=n)))
    return x, _late(x, 0.5 * rng.normal(size=n))


def _swing(rng: np.random.Generator, n: int) -> Pair:
    x = resonance(rng, n)
    return x + 0.1 * rng.normal(size=n), _late(x, 0.1 * rng.normal(size=n))


def _valve(rng: np.random.Generator, n: int) -> Pair:
    """Square wave whose half periods differ."""
    phase = np.cumsum(1 + 0.15 * rng.normal(size=n)) / PERIOD
    x = np.sign(np.sin(2 * np.pi * phase))
    return x + 0.1 * rng.normal(size=n), _late(x, 0.1 * rng.normal(size=n))


def _square(rng: np.random.Generator, n: int) -> Pair:
    x, e = rng.normal(size=(2, n))
    return x, np.asarray(lfilter([1.0], [1.0, -0.5], e + 0.6 * np.roll(x, 2) ** 2))


def _size(rng: np.random.Generator, n: int) -> Pair:
    """Only how much the second is disturbed follows from the first."""
    x, e = rng.normal(size=(2, n))
    return x, np.asarray(lfilter([1.0], [1.0, -0.5], e * np.exp(0.7 * np.roll(x, 2))))


PAIRS: Mapping[str, Draw] = MappingProxyType(
    {
        "noise through a lag": _noise,
        "a swing of a linear loop through a lag": _swing,
        "a square wave through a lag": _valve,
        "by its square": _square,
        "by the size of the other's noise": _size,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What was said of one pair: there and backwards."""

    arrows: Granger
    there: TransferEntropy
    back: TransferEntropy


def look(pair: Pair) -> Seen:
    """Ask both ways by both means.

    Parameters
    ----------
    pair : tuple of ndarray
        Cause and effect.
    """
    x, y = pair
    return Seen(
        arrows=granger(np.array([x, y])), there=transfer_entropy(x, y), back=transfer_entropy(y, x)
    )


def run() -> Section:
    """Draw pairs, ask, and hold Granger's F to statsmodels'."""
    rng = np.random.default_rng(SEED)
    drawn = {name: [draw(rng, SAMPLES) for _ in range(COUNT)] for name, draw in PAIRS.items()}
    alone = [(resonance(rng, SHORT), resonance(rng, SHORT)) for _ in range(INDEPENDENT)]
    with ProcessPoolExecutor(2) as pool:
        seen = {name: list(pool.map(look, pairs)) for name, pairs in drawn.items()}
        nothing = list(pool.map(transfer_entropy, *zip(*alone, strict=True), chunksize=10))
    apart = max(
        difference_of_f(pair, one.arrows)
        for name, pairs in drawn.items()
        for pair, one in zip(pairs, seen[name], strict=True)
    )
    low = sum(one.p_value is not None and one.p_value <= 0.05 for one in nothing)
    false = sum(one.significant for one in nothing)
    back = [one for many in seen.values() for one in many]
    wrong = sum(one.back.significant for one in back) / len(back)
    pair = _noise(rng, TIMED)
    times, order = _times(pair)
    return Section(
        title="Who drives whom of two signals",
        how=(
            f"{COUNT} pairs of {SAMPLES} samples of each kind: the share in which an arrow is seen "
            "along the link, and against it. On all of them Granger's F at the order chosen is "
            "held to that of statsmodels' `grangercausalitytests`."
        ),
        columns=COLUMNS,
        rows=tuple(_row(name, many) for name, many in seen.items()),
        targets=(
            Target(what="largest relative difference of F from statsmodels", limit=1e-6,
                   reached=apart, unit=""),
            Target(what="links seen by transfer entropy, worst kind", limit=90.0, unit="%",
                   reached=min(_share([one.there.significant for one in many])
                               for many in seen.values()), at_least=True),
            Target(what="transfer entropy against the link", limit=2.0, reached=100 * wrong,
                   unit="%"),
            Target(what="transfer entropy of two signals of 4,000 samples", limit=1.0,
                   reached=times["transfer entropy"], unit="s"),
        ),
        notes=(
            "Swings and square waves are seen through noise of their own in both signals: the "
            "past of the one then helps to tell what noise hides in the other, and both tell.",
            f"Of {INDEPENDENT} pairs of independent swings of one period, {SHORT} samples, "
            f"{100 * low / INDEPENDENT:.1f} % have a p-value of 0.05 or less, and "
            f"{100 * false / INDEPENDENT:.1f} % an arrow.",
            f"{TIMED} samples, both directions, processor time: Granger with choice of order "
            f"({order}) and 39 shifts {duration(times['granger'])}, statsmodels at that order "
            f"without either {duration(times['statsmodels'])}; transfer entropy, one direction, "
            f"with choice of delay and 39 shifts {duration(times['transfer entropy'])}.",
        ),
    )  # fmt: skip


def statsmodels_f(pair: Pair, order: int) -> tuple[float, float]:
    """F of the first for the second, and of the second for the first, by statsmodels.

    Parameters
    ----------
    pair : tuple of ndarray
        Two signals.
    order : int
        Lags of both. [samples]
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of an argument that later versions drop
        found = [
            grangercausalitytests(np.column_stack([effect, cause]), [order])[order][0]["ssr_ftest"]
            for cause, effect in (pair, pair[::-1])
        ]
    return float(found[0][0]), float(found[1][0])


def difference_of_f(pair: Pair, found: Granger) -> float:
    """Largest relative difference of F from statsmodels', of both directions.

    Parameters
    ----------
    pair : tuple of ndarray
        Two signals.
    found : Granger
        What was said of them.
    """
    if found.order is None:
        return np.inf
    return max(
        abs(ours - theirs) / theirs
        for ours, theirs in zip(
            _f_values(found, pair[0].size, found.order),
            statsmodels_f(pair, found.order),
            strict=True,
        )
    )


def _f_values(found: Granger, n: int, order: int) -> Iterator[float]:
    """F from the strengths, ln(RSS without / with)."""
    freedom = n - order - (2 * order + 1)
    for arrow in sorted(found.arrows, key=lambda one: one.cause):
        yield float(np.expm1(arrow.strength)) * freedom / order


def _times(pair: Pair) -> tuple[dict[str, float], int]:
    order = granger(np.array(pair)).order or 1
    timed = interleaved(
        {
            "granger": lambda: granger(np.array(pair)),
            "statsmodels": lambda: statsmodels_f(pair, order),
            "transfer entropy": lambda: transfer_entropy(*pair),
        },
        repeats=5,
        seconds=10.0,
    )
    return {name: one.median for name, one in timed.items()}, order


def _share(flags: list[bool]) -> float:
    return 100 * sum(flags) / len(flags)


def _row(name: str, seen: list[Seen]) -> tuple[str, ...]:
    shares = (
        _share([one.arrows.drives(0, 1) for one in seen]),
        _share([one.there.significant for one in seen]),
        _share([one.arrows.drives(1, 0) for one in seen]),
        _share([one.back.significant for one in seen]),
    )
    return (name, *(f"{share:.0f} %" for share in shares))
