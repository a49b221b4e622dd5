"""The Tennessee Eastman plant: sticking valves that are known, and what is said of its 17 loops.

Nothing of the product was chosen on this plant.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from advice.assess import assess
from advice.plantwide import plant_oscillations
from advice.plantwide_result import OscillationGroup
from benchmarks.eastman_plant import STICKING, EastmanRun, available, eastman_run
from benchmarks.section import Section, Target
from monitoring.stiction_result import StictionVerdict

HOURS = 12.0
LEVELS = ("Reactor level", "Separator level", "Stripper level")
# Number of the fault and seed of the measurement noise.
RUNS = (
    (None, 1), (None, 2), (None, 3), (14, 1), (14, 2), (14, 3), (15, 1), (19, 1), (19, 2),
)  # fmt: skip
COLUMNS = ("run", "valve that sticks", "stem at rest", "valve called sticking", "groups", "named")
# A stem that moves less than this between two samples stands still. [%]
AT_REST = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """What was said of one run.

    Attributes
    ----------
    fault : int or None
        Number of the disturbance.
    run : EastmanRun
        The records and the truth.
    sticking : tuple of str
        Loops whose valve was called sticking, one by one.
    groups : tuple of OscillationGroup
        Loops that swing together.
    """

    fault: int | None
    run: EastmanRun
    sticking: tuple[str, ...]
    groups: tuple[OscillationGroup, ...]

    @property
    def truth(self) -> tuple[str, ...]:
        """Loops whose valve sticks."""
        return () if self.fault is None else STICKING[self.fault]

    def at_rest(self, tag: str) -> float:
        """Part of the samples at which a stem has not moved. [-]"""
        return float(np.mean(np.abs(np.diff(self.run.stems[tag])) < AT_REST))


def run() -> Section:
    """Run the plant and look at it."""
    if not available():
        return Section(
            title="Tennessee Eastman", how="Not run: the package `tep-studio` is not installed "
            "(dependency group `plants`).", columns=COLUMNS, rows=(),
        )  # fmt: skip
    started = time.perf_counter()
    found = [look(fault, seed=seed) for fault, seed in RUNS]
    normal = [one for one in found if one.fault is None]
    reactor = [one for one in found if one.fault == 14]
    alarms = sum(len(one.sticking) + len(one.groups) for one in normal)
    return Section(
        title="Tennessee Eastman",
        how=(
            f"The 17 loops of the plant under its decentralised control, {HOURS:g} h at 7.2 s "
            "each, with the assessment of every loop and the plant-wide look at all of them. "
            "Nothing was chosen on it. The loops are called as in the package tep-studio; where a "
            "loop is named, the likeliest source follows with its probability, then the loops "
            "that it drags along."
        ),
        columns=COLUMNS,
        rows=tuple(_row(one, seed) for one, (_, seed) in zip(found, RUNS, strict=True)),
        targets=(
            Target(
                what="runs of IDV 14 whose groups name the reactor cooling valve alone",
                limit=len(reactor), reached=sum(named_loops(one) == one.truth for one in reactor),
                unit="", at_least=True,
            ),
            Target(
                what="other valves that the assessment of single loops calls sticking, all runs",
                limit=0, reached=sum(len({*one.sticking} - {*one.truth}) for one in found),
                unit="",
            ),
            Target(
                what="false alarms in normal operation, valves and groups",
                limit=0, reached=alarms, unit="",
            ),
        ),
        notes=(
            "IDV 15 has nothing to be found: the noise of the reactor level, through the cascade, "
            "moves the output of the separator's cooling valve by more than its stick band from "
            "one scan to the next; its true stem rests no more than in normal operation.",
            "IDV 19 has two valves that cycle on their own, with different periods: two groups. "
            "Its recycle and steam valves stand still in this control.",
            f"All runs with both looks: {time.perf_counter() - started:.0f} s.",
        ),
    )  # fmt: skip


def look(fault: int | None, *, seed: int, hours: float = HOURS) -> Found:
    """Run the plant once and look at all loops.

    Parameters
    ----------
    fault : int or None
        Number of the disturbance.
    seed : int
        Seed of the measurement noise.
    hours : float
        Length of the records. [h]
    """
    run = eastman_run(fault, hours=hours, seed=seed)
    together = plant_oscillations(run.records, levels=LEVELS)
    return Found(
        fault=fault, run=run, sticking=sticking_valves(run), groups=together.groups
    )  # fmt: skip


def sticking_valves(run: EastmanRun) -> tuple[str, ...]:
    """List the loops whose valve the assessment calls sticking.

    Parameters
    ----------
    run : EastmanRun
        One run.
    """
    tags = []
    for record in run.records:
        kind = "level" if record.tag in LEVELS else "other"
        indices = assess(record, kind=kind, op_range=run.op_ranges[record.tag]).indices
        control = None if indices is None else indices.control
        if control is not None and control.stiction.verdict is StictionVerdict.STICTION:
            tags.append(record.tag)
    return tuple(tags)


def named_loops(one: Found) -> tuple[str, ...]:
    """List the loops that groups were traced to.

    Parameters
    ----------
    one : Found
        What was said of a run.
    """
    return tuple(group.source for group in one.groups if group.source is not None)


def _row(one: Found, seed: int) -> tuple[str, ...]:
    fault = "normal" if one.fault is None else f"IDV {one.fault}"
    rests = ", ".join(f"{100 * one.at_rest(tag):.0f} %" for tag in one.truth)
    return (
        f"{fault}, seed {seed}",
        ", ".join(one.truth) or "none",
        rests or "–",
        ", ".join(one.sticking) or "none",
        str(len(one.groups)),
        "; ".join(said_of(group, one.truth) for group in one.groups) or "–",
    )


def said_of(group: OscillationGroup, truth: Sequence[str]) -> str:
    """Say in short what was said of a group.

    Parameters
    ----------
    group : OscillationGroup
        Loops that swing together.
    truth : sequence of str
        Loops whose valve sticks.
    """
    first, *others = group.suspects
    victims = ", ".join(suspect.tag for suspect in others)
    if group.source is not None:
        return f"**{group.source}** ({first.probability:.2f}), drags {victims}"
    places = [k for k, one in enumerate(group.suspects, start=1) if one.tag in truth]
    rank = f", the true loop ranked {places[0]}" if places else ""
    return f"undecided ({first.tag} {first.probability:.2f}{rank}) among {len(group.suspects)}"
