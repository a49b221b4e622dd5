"""Stiction on simulated windows of plant history: false alarms, detection, calibration.

    python -m benchmarks.stiction_windows

Limits and weights were fixed before this seed was drawn.
"""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.false_alarms import auc
from benchmarks.section import Section, Target
from benchmarks.virtual_windows import DAY, NEITHER, NEVER, Family, Truth, Window, windows
from loop.signals import Real
from monitoring.loop_signals import Stretch
from monitoring.oscillation import oscillation
from monitoring.stiction import stiction
from monitoring.stiction_result import StictionVerdict

SEED = 990
COUNT = 176
SIZES = ((0.4, 1.0), (1.0, 2.0), (2.0, 4.0), (4.0, 12.1), (NEVER, NEVER + 1))
EDGES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.001)


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowOutcome:
    """What was said of one window.

    Attributes
    ----------
    family : Family
        What the loop controls.
    truth : Truth
        What is true of it.
    day : bool
        Whether the window is a day; the others are hours.
    S : float
        True stiction band, 100 for a valve that never moves. [%]
    verdict : StictionVerdict
        Word on the valve.
    probability : float
        Probability of stiction; one half where it was refused. [-]
    """

    family: Family
    truth: Truth
    day: bool
    S: float
    verdict: StictionVerdict
    probability: float


def judged(one: Window) -> WindowOutcome:
    """Judge one window as the product does."""
    stretch = Stretch(first=0, dt=one.dt, pv=one.pv, op=one.op, sp=one.sp, share=1.0)
    found = stiction(stretch, oscillation(stretch.error, one.dt), integrating=one.integrating)
    return WindowOutcome(
        family=one.family,
        truth=one.truth,
        day=one.dt * one.pv.size > DAY,
        S=one.S,
        verdict=found.verdict,
        probability=0.5 if found.probability is None else found.probability,
    )


def outcomes(family: Family, count: int = COUNT, *, seed: int = SEED) -> list[WindowOutcome]:
    """Judge windows of one family, sound and sticking ones."""
    return [
        judged(one)
        for sticking in (False, True)
        for one in windows(family, count, sticking=sticking, seed=seed)
    ]


def reliability(found: list[WindowOutcome]) -> list[tuple[float, float, int]]:
    """Stated and true share of sticking windows and their number, for ten intervals.

    Both classes weigh the same; windows in which the sticking does not matter are left out.
    """
    kept = [one for one in found if one.truth not in NEITHER]
    p = np.array([one.probability for one in kept])
    y = np.array([one.truth is Truth.STICKING for one in kept])
    weight = np.where(y, 0.5 / np.mean(y), 0.5 / np.mean(~y))
    rows = []
    for low, high in pairwise(EDGES):
        inside = (p >= low) & (p < high)
        if np.any(inside):
            total = float(np.sum(weight[inside]))
            rows.append((
                float(np.sum((weight * p)[inside])) / total,
                float(np.sum((weight * y)[inside])) / total,
                int(np.count_nonzero(inside)),
            ))  # fmt: skip
    return rows


def by_size(found: list[WindowOutcome]) -> list[tuple[float, float, float, int]]:
    """Bounds of S, part found and number of windows in which the sticking matters."""
    rows = []
    for low, high in SIZES:
        said = [
            one.verdict is StictionVerdict.STICTION
            for one in found
            if one.truth is Truth.STICKING and low <= one.S < high
        ]
        if said:
            rows.append((low, high, float(np.mean(said)), len(said)))
    return rows


def all_outcomes(count: int = COUNT) -> list[WindowOutcome]:
    """Judge windows of all families on two cores."""
    with ProcessPoolExecutor(2) as pool:
        return [one for part in pool.map(outcomes, Family, [count] * len(Family)) for one in part]


def measure(*, count: int = COUNT) -> Section:
    """Judge windows of all families."""
    found = all_outcomes(count)
    hours, days = [one for one in found if not one.day], [one for one in found if one.day]
    return Section(
        title="Stiction in simulated windows of plant history",
        how=(
            f"Six families, seed {SEED}, which neither weights nor limits have seen; mostly two "
            "hours at 10 s, and days at 10 s and 1 min. PV and OP rounded, averaged, held or "
            "stored by exception; most loops without a set-point move, sticking mostly without a "
            "regular cycle. A valve's lost motion matters where it is half of what OP asks for and "
            "twice the noise of PV; sticking valves where it does not, and sound ones where it "
            "does, stand by themselves and are not counted."
        ),
        columns=("length", "truth", "windows", "called sticking", "undecided", "called sound"),
        rows=tuple(
            _row(length, truth, part)
            for length, part in (("hours", hours), ("a day", days))
            for truth in Truth
        ),
        targets=(*_targets("", hours), *_targets(" of a day", days)),
        notes=tuple(
            note
            for length, part in (("Hours", hours), ("Days", days))
            for note in _notes(length, part)
        ),
    )


def _targets(length: str, found: list[WindowOutcome]) -> tuple[Target, ...]:
    healthy, sticking = (
        [one for one in found if one.truth is truth] for truth in (Truth.HEALTHY, Truth.STICKING)
    )
    return (
        Target(what=f"healthy windows{length} called sticking", limit=1.0, unit="%",
               reached=_percent(healthy, StictionVerdict.STICTION)),
        Target(what=f"healthy windows{length} undecided", limit=20.0, unit="%",
               reached=_percent(healthy, StictionVerdict.UNDECIDED)),
        Target(what=f"sticking windows{length} undecided", limit=20.0, unit="%",
               reached=_percent(sticking, StictionVerdict.UNDECIDED)),
    )  # fmt: skip


def _notes(length: str, found: list[WindowOutcome]) -> tuple[str, ...]:
    families = "; ".join(f"{family.value} {_auc(found, family):.3f}" for family in Family)
    sizes = "; ".join(
        ("never moves" if low == NEVER else f"S {low:g} to {high:.0f} %")
        + f" {100 * part:.0f} % of {n}"
        for low, high, part, n in by_size(found)
    )
    stated = ", ".join(f"{said:.2f}/{true:.2f} ({n})" for said, true, n in reliability(found))
    return (
        f"{length}: AUC, sticking against all others: {_auc(found, None):.3f}; {families}.",
        f"{length}: detection by size: {sizes}.",
        f"{length}: reliability, stated/true (windows): {stated}.",
    )


def run() -> Section:
    """Measure with the numbers of windows that the pages speak of."""
    return measure()


def _percent(found: list[WindowOutcome], verdict: StictionVerdict) -> float:
    return 100 * float(np.mean([one.verdict is verdict for one in found])) if found else np.nan


def _row(length: str, truth: Truth, found: list[WindowOutcome]) -> tuple[str, ...]:
    kind = [one for one in found if one.truth is truth]
    words = (StictionVerdict.STICTION, StictionVerdict.UNDECIDED, StictionVerdict.NONE)
    said = tuple(f"{_percent(kind, word):.1f} %" if kind else "-" for word in words)
    return (length, truth.value, str(len(kind)), *said)


def _auc(found: list[WindowOutcome], family: Family | None) -> float:
    kept = [
        one
        for one in found
        if one.truth not in NEITHER and (family is None or one.family is family)
    ]
    label: Real = np.array([float(one.truth is Truth.STICKING) for one in kept])
    return auc(label, np.array([one.probability for one in kept]))


if __name__ == "__main__":
    from benchmarks.section import as_markdown

    print(as_markdown(run()))
