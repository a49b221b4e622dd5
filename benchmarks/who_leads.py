"""Where a shared oscillation begins: how often the true loop comes first, by which evidence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from benchmarks.origin_weights import Example, examples
from benchmarks.section import Section, Target
from benchmarks.shared_swings import LOOPS, Origin, Topology
from loop.signals import Real
from monitoring.origin import NAMED_FROM, NAMES, origin_model
from monitoring.shared_oscillations import SIMILAR, shared_oscillations

SEED, COUNT = 12, 10
# Independent swings: samples a period, cycles over which they remember themselves, pairs.
PERIOD, MEMORY, PAIRS, CYCLES = 40.0, 8.0, 200, (15, 40, 100)
COLUMNS = (
    "plants", "count", "group holds the loop", "non-linearity", "valve", "Granger", "lead",
    "all together", "named", "of them wrong",
)  # fmt: skip
ALONE = (
    "non-linearity ahead of the others", "log odds that the valve sticks", "net Granger flow",
    "lead in phase",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """How one kind of plant came out.

    Attributes
    ----------
    plants, groups : int
        How many were simulated, and in how many a group holds the loop where it begins.
    alone : tuple of float
        Part of the groups in which the true loop comes first by each evidence alone.
    together : float
        The same by all of it.
    named, wrong : int
        Groups in which a loop was named, and in which that was not the true one.
    outside : int
        Groups in which a cause outside is likelier than the limit.
    """

    plants: int
    groups: int
    alone: tuple[float, ...]
    together: float
    named: int
    wrong: int
    outside: int


def run() -> Section:
    """Simulate plants that the weights have not seen, and rank."""
    found = list(examples(SEED, COUNT))
    begins = [one for one in found if one.origin is not Origin.COMMON]
    kinds = [(str(o.value), [one for one in found if one.origin is o]) for o in Origin]
    kinds += [
        (f"{top.value}, begins in one loop", [one for one in begins if one.topology is top])
        for top in Topology
    ]
    every = tally(begins)
    everywhere = tally([one for one in found if one.origin is Origin.COMMON])
    named, wrong = every.named + everywhere.named, every.wrong + everywhere.wrong
    rows = [_row(name, tally(plants)) for name, plants in kinds]
    return Section(
        title="Where a shared oscillation begins",
        how=(
            f"Simulated plants of {LOOPS} loops, "
            f"{COUNT} of each topology and origin, 3,400 samples each; the weights were fitted on "
            "others. Part of the groups in which the true loop is ranked first, by each evidence "
            "alone (ties share) and by all together; and how often a loop is named, which takes a "
            f"probability of {NAMED_FROM}."
        ),
        columns=COLUMNS,
        rows=tuple(rows),
        targets=(
            Target(what="true loop first, all evidence", limit=90.0,
                   reached=100 * every.together, unit="%", at_least=True),
            Target(what="named loops that are wrong", limit=5.0,
                   reached=100 * wrong / max(named, 1), unit="%"),
        ),
        notes=(
            f"By non-linearity alone the true loop came first in {100 * every.alone[0]:.0f} % of "
            f"{every.groups} groups, by all evidence in {100 * every.together:.0f} %.",
            f"Where the oscillation entered all loops at once, the answer was a cause outside in "
            f"{everywhere.outside} of {everywhere.groups} groups, and a loop was named in "
            f"{everywhere.named}.",
            by_chance(),
            "Plants in which no group holds the loop are mostly those whose valve does not make "
            "the loop cycle, or whose tight loop dies out.",
        ),
    )  # fmt: skip


def by_chance() -> str:
    """Say how often independent loops of nearly one period are taken for one group."""
    rng = np.random.default_rng(SEED)
    said = []
    for cycles in CYCLES:
        found = alike = 0
        for _ in range(PAIRS):
            other = PERIOD * rng.uniform(0.98, 1.02)
            pair = np.array([_swing(rng, PERIOD, cycles), _swing(rng, other, cycles)])
            found += len(shared_oscillations(pair, np.array([PERIOD, other])))
            alike += _spectra_alike(pair, (PERIOD + other) / 2)
        said.append(f"{100 * found / PAIRS:.0f} % ({100 * alike / PAIRS:.0f} %) in {cycles} cycles")
    return (
        f"Pairs of independent swings of periods within 2 % of each other that would make a group "
        f"(in brackets: with spectra that are alike by a cosine of {SIMILAR}): {', '.join(said)}; "
        f"{PAIRS} pairs each, that remember themselves for {MEMORY:g} cycles."
    )


def _swing(rng: np.random.Generator, period: float, cycles: int) -> Real:
    """A resonance driven by noise."""
    w, r = 2 * np.pi / period, np.exp(-1 / (MEMORY * period))
    n, before = round(cycles * PERIOD), round(5 * MEMORY * period)
    wave = lfilter([1.0], [1.0, -2 * r * np.cos(w), r * r], rng.normal(size=n + before))
    return np.asarray(wave[before:])


def _spectra_alike(pair: Real, period: float) -> bool:
    n = pair.shape[1]
    spectra = np.abs(np.fft.rfft(pair * np.hanning(n), axis=1))
    a, b = spectra[:, int(n / period / 2**0.5) : int(np.ceil(n / period * 2**0.5)) + 1]
    return bool(a @ b >= SIMILAR * np.linalg.norm(a) * np.linalg.norm(b))


def tally(found: Sequence[Example]) -> Tally:
    """Count how plants came out.

    Parameters
    ----------
    found : sequence of Example
        Plants of one kind.
    """
    groups = [one for one in found if one.swing is not None]
    model = origin_model()
    chances = [model.probabilities(one.features, one.strongest) for one in groups]
    begun = [(one, p) for one, p in zip(groups, chances, strict=True) if one.truth is not None]
    named = [
        (one.truth, int(np.argmax(p[:-1])))
        for one, p in zip(groups, chances, strict=True)
        if np.max(p[:-1]) >= NAMED_FROM
    ]
    return Tally(
        plants=len(found),
        groups=len(groups),
        alone=tuple(
            _mean([_first(one.features[:, NAMES.index(name)], one.truth) for one, _ in begun])
            for name in ALONE
        ),
        together=_mean([_first(p[:-1], one.truth) for one, p in begun]),
        named=len(named),
        wrong=sum(truth != place for truth, place in named),
        outside=sum(bool(p[-1] >= NAMED_FROM) for p in chances),
    )


def _first(values: Real, truth: int | None) -> float:
    """1 where the true loop has the largest value, a part of it where others have it too."""
    best = np.isclose(values, np.max(values), atol=1e-12)
    return float(best[truth] / np.count_nonzero(best)) if truth is not None else np.nan


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else np.nan


def _row(name: str, one: Tally) -> tuple[str, ...]:
    return (
        name, str(one.plants), str(one.groups), *(_percent(part) for part in one.alone),
        _percent(one.together), str(one.named), str(one.wrong),
    )  # fmt: skip


def _percent(part: float) -> str:
    return "–" if np.isnan(part) else f"{100 * part:.0f} %"
