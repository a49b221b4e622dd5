"""Advice from imperfect data, judged on the plant that the data came from.

A plant and a quality of data are drawn, the record goes through identification to the recommended
settings, and the settings are put on the true plant. What counts is how often that loop is unstable
or has Ms above 3. Refusing everything, or settings that sleep, would buy a zero, so both stand
beside it.
"""

import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from advice.tune import tune
from benchmarks.random_plants import (
    DataQuality,
    Plant,
    random_plant,
    random_quality,
    routine_day,
    running_settings,
    step_test,
)
from benchmarks.section import Section, Target, as_markdown
from loop.controller import PID
from loop.errors import LoopDiverged, LoopError, UnstableLoop
from loop.margins import margins
from loop.process import FOPDT, SOPDT
from loop.record import Record
from loop.simulation import simulate
from tuning.catalogue import RULES
from tuning.profiles import DEFAULT_PROFILE, PROFILES
from tuning.robust import robust_tau_c

PLANTS = 1_000
UNSAFE = 3.0
ROUTES = ("step test", "routine data")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of one record.

    Attributes
    ----------
    route, family : str
        Kind of record and of plant.
    seed : int
        That drew both.
    good : bool
        Whether advice was owed.
    verdict : str
        Of the model.
    advised : bool
        Whether settings were recommended.
    Ms : float
        On the true plant, infinite where that loop is unstable; 0 without advice. [-]
    area : float
        Load IAE over that of the robust SIMC settings for the true plant, 0 where it is not known.
        [-]
    model, truth, reason : str
        For looking at it.
    """

    route: str
    family: str
    seed: int
    good: bool
    verdict: str
    advised: bool
    Ms: float
    area: float
    model: str = ""
    truth: str = ""
    reason: str = ""

    @property
    def unsafe(self) -> bool:
        """Whether the advice would have done harm."""
        return self.advised and self.Ms > UNSAFE


def outcome(seed: int, route: str) -> Outcome | None:
    """Draw a plant with its data and follow the advice; None where no loop could run on it."""
    rng = np.random.default_rng([seed, ROUTES.index(route)])
    plant, quality = random_plant(rng), random_quality(rng)
    record = _record(plant, quality, route, rng)
    if record is None:
        return None
    case = tune(record)
    model, best = case.model, case.best
    verdict = "refused" if model is None else model.verdict.value
    Ms, area = 0.0, 0.0
    pid = None if best is None else best.proposal.pid
    if pid is not None:
        Ms = _peak(plant, pid)
        area = _load_area(plant, pid) if route == ROUTES[0] or Ms < UNSAFE else 0.0
    owed = quality.good and (route == ROUTES[0] or _moved(record))
    return Outcome(
        route=route, family=plant.family, seed=seed, good=owed, verdict=verdict,
        advised=pid is not None, Ms=Ms, area=area, model=repr(case.process),
        truth=f"{plant.process} {quality}",
        reason=model.reasons[0] if model is not None and model.reasons else "",
    )  # fmt: skip


def _record(
    plant: Plant, quality: DataQuality, route: str, rng: np.random.Generator
) -> Record | None:
    if route == ROUTES[0]:
        return step_test(plant, quality, rng)
    running = running_settings(plant, rng)
    return None if running is None else routine_day(plant, quality, running, rng)


def _moved(record: Record) -> bool:
    """Whether somebody moved the set point by twenty times the largest good noise."""
    return record.sp is not None and float(np.ptp(record.sp)) >= 0.2


def _peak(plant: Plant, pid: PID) -> float:
    try:
        return margins(plant.process, pid).Ms
    except UnstableLoop:
        return math.inf


def _load_area(plant: Plant, pid: PID) -> float:
    """Load IAE on the true plant over that of robust SIMC settings made for it."""
    if not isinstance(plant.process, FOPDT | SOPDT):
        return 0.0
    structure = "PI" if isinstance(plant.process, FOPDT) else "PID"
    try:
        best = robust_tau_c(plant.process, RULES["simc"], structure, PROFILES[DEFAULT_PROFILE])
    except LoopError:
        return 0.0
    ours, theirs = (_absolute_error(plant, settings) for settings in (pid, best.pid))
    return ours / theirs


def _absolute_error(plant: Plant, pid: PID) -> float:
    t_end = 30 * plant.duration + 5 * pid.Ti
    try:
        run = simulate(plant.process, pid, t_end=t_end, dt=t_end / 4000, load=1.0)
    except LoopDiverged:
        return math.inf
    return float(np.sum(np.abs(run.pv)) * t_end / 4000)


def outcomes(seeds: range, route: str) -> list[Outcome]:
    """Follow the advice for many seeds."""
    found = (outcome(seed, route) for seed in seeds)
    return [one for one in found if one is not None]


def run(plants: int = PLANTS, first: int = 0) -> Section:
    """Follow the advice for step tests and for routine data, from a first seed on."""
    seeds = range(first, first + plants)
    return section({route: outcomes(seeds, route) for route in ROUTES})


def section(found: Mapping[str, Sequence[Outcome]]) -> Section:
    """Count what became of the records of each route."""
    rows, targets = [], []
    for route, outcomes_of in found.items():
        row, limits = _counted(route, outcomes_of)
        rows.append(row)
        targets += limits
    return Section(
        title="Unsafe advice",
        how=(
            "Random plants (first order, second order and the process batch of Åström and "
            "Hägglund without its integrators) with random data: noise of 0.2-5 % of the response, "
            "drift, loads, quantisation, gaps, coarse and fine samples, short and long records. "
            "Each record goes through identification to the recommended settings, which are put on "
            f"the true plant: unsafe is an unstable loop or Ms above {UNSAFE:g}. Good data have "
            "noise of at most 1 %, at least 5 (tau + theta) of answer, no drift, load or gap, 20 "
            "samples in tau + theta, and in automatic a set-point move of 20 times the noise."
        ),
        columns=(
            "data", "records", "models", "advised", "unsafe", "largest Ms", "good data refused",
            "load IAE",
        ),
        rows=tuple(rows),
        targets=tuple(targets),
        notes=(
            "Load IAE is the median over that of SIMC at the smallest tau_c that passes, made for "
            "the true plant; for first and second order only.",
        ),
    )  # fmt: skip


def _counted(route: str, found: Sequence[Outcome]) -> tuple[tuple[str, ...], list[Target]]:
    """Row and targets of one route."""
    advised = [one for one in found if one.advised]
    unsafe = sum(one.unsafe for one in found)
    owed = [one for one in found if one.good]
    refused = sum(not one.advised for one in owed) / max(len(owed), 1)
    area = float(np.median([one.area for one in advised if one.area > 0] or [0.0]))
    verdicts = Counter(one.verdict for one in found)
    row = (
        route,
        f"{len(found):,}",
        ", ".join(f"{count} {verdict}" for verdict, count in sorted(verdicts.items())),
        f"{len(advised):,}",
        f"{unsafe}",
        f"{max((one.Ms for one in advised), default=0.0):.2f}",
        f"{refused:.1%} of {len(owed)}",
        f"{area:.2f}",
    )
    targets = [
        Target(what=f"{route}, unsafe advice", limit=0.0, reached=float(unsafe), unit=""),
        Target(what=f"{route}, good data refused", limit=15.0, reached=100 * refused, unit="%"),
        Target(what=f"{route}, median load IAE", limit=2.0, reached=area, unit=""),
    ]
    return row, targets


def main() -> None:
    """Print the section for so many plants from a seed on; `make bench` has no time for it."""
    print(as_markdown(run(*map(int, sys.argv[1:3]))))


if __name__ == "__main__":
    main()
