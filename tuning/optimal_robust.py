"""Optimal settings that hold over everything the model may be: a box of errors, or draws of it.

The area is that of the model; the limits must hold on the whole set. Over a box they are proven,
and a plant that breaks them is taken into the set and the gain lowered. Over draws a stated part
of them may miss the limits.
"""

from dataclasses import dataclass, fields, replace
from itertools import product

import numpy as np
from scipy.stats import beta

from loop.batch import LagProcess
from loop.controller import DEFAULT_N
from loop.process import SOPDT, Process, TransferFunction
from loop.signals import Real
from tuning.box_proof import DEFAULT_ERRORS
from tuning.box_verdict import BoxVerdict, hold_box
from tuning.gain_polish import Judge
from tuning.loop_limits import LoopLimits
from tuning.optimal_search import Objective, OptimalSettings, Search, Structure
from tuning.plant_set import PlantSet
from tuning.uncertain_loop import Errors, error_sizes, moved_plant

# The gain is taken this far inside the limits, so that the proof has room for its cells.
ROOM = 0.004
ROUNDS = 8
# Draws that the search looks at, those at the edge of what may be missed, and how often.
EDGE, LOOKS, FEWEST = 8, 4, 20
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoxOptimum:
    """Settings of least area that keep the limits over a box.

    Attributes
    ----------
    settings : OptimalSettings
        The settings with areas and margins at the model.
    verdict : BoxVerdict
        The proof; `holds` is None where its budget ran out, and False where no gain near the one
        found was proven in eight rounds.
    errors : dict of str to float
        The box. [-]
    """

    settings: OptimalSettings
    verdict: BoxVerdict
    errors: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DrawOptimum:
    """Settings of least area that keep the limits on a stated part of the draws.

    Attributes
    ----------
    settings : OptimalSettings
        The settings with areas and margins at the model.
    draws, missed : int
        Number of draws, and of those on which a limit does not hold.
    probability : float
        Part of the draws on which all limits hold. [-]
    at_least : float
        What that says of the probability with a confidence of 95 % (Clopper-Pearson). The times
        are chosen with the same draws, so it is a little optimistic. [-]
    """

    settings: OptimalSettings
    draws: int
    missed: int
    probability: float
    at_least: float


def optimal_over_box(
    process: Process,
    limits: LoopLimits,
    *,
    structure: Structure = "PI",
    objective: Objective = "load",
    errors: Errors = DEFAULT_ERRORS,
    N: float = DEFAULT_N,
    sample_time: float = 0.0,
) -> BoxOptimum:
    """Minimise the error area of the model under limits that hold over a whole box of errors.

    Parameters
    ----------
    process : Process
        Model, middle of the box.
    limits : LoopLimits
        What to keep everywhere; the effort at the model.
    structure : "PI" or "PID"
        Terms in use.
    objective : str
        As in `optimal`.
    errors : tuple of float or mapping of str to float
        Relative errors of (K, tau, theta), or by name. [-]
    N : float
        Derivative filter ratio. [-]
    sample_time : float
        Scan time. [s]

    Raises
    ------
    RuleNotApplicable
        Nothing bounds the gain, or no settings keep the limits over the box.
    ValueError
        As in `optimal` and `prove_box`.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> from tuning.profiles import PROFILES
    >>> heater = FOPDT(K=2.0, tau=120.0, theta=30.0)
    >>> found = optimal_over_box(heater, LoopLimits.of(PROFILES["general"]))
    >>> found.verdict.holds, 0.35 < found.settings.pid.Kc < 0.36
    (True, True)
    """
    search = Search.of(process, limits, structure, N, sample_time)
    sizes = error_sizes(process, errors)
    plants = _corners(process, sizes)
    on_grid = PlantSet.of(
        plants,
        search.speed,
        gain_error=sizes["K"],
        theta_error=sizes["theta"],
        hold=search.hold,
    )
    judge = Judge(
        plants=(process, *_at_the_ends(plants, sizes)),
        limits=_tightened(limits),
        sample_time=sample_time,
    )
    best = search.best(on_grid, objective)
    for _ in range(ROUNDS):
        settings = search.settle(best, judge, objective)
        verdict = hold_box(
            process, settings.pid, limits.profile(), errors=sizes, sample_time=sample_time
        )
        if verdict.plant is None:
            break
        judge = judge.with_plant(verdict.plant)
        best = settings.pid, best[1]
    return BoxOptimum(settings=settings, verdict=verdict, errors=sizes)


def optimal_over_draws(
    process: LagProcess,
    draws: Real,
    limits: LoopLimits,
    *,
    probability: float = 0.95,
    structure: Structure = "PI",
    objective: Objective = "load",
    N: float = DEFAULT_N,
    sample_time: float = 0.0,
) -> DrawOptimum:
    """Minimise the error area of the model under limits that hold on a part of many draws of it.

    Parameters
    ----------
    process : FOPDT, SOPDT, IPDT or DoubleIntegrator
        The model.
    draws : ndarray, shape (n, p)
        Draws of the model's own parameters in their order, (K, tau, theta) of an FOPDT, as
        identification makes them. [PV/OP], [s], [s]
    limits : LoopLimits
        What to keep.
    probability : float
        Part of the draws on which all limits must hold. [-]
    structure, objective, N, sample_time
        As in `optimal`.

    Raises
    ------
    RuleNotApplicable
        Nothing bounds the gain, or no settings keep the limits on so many draws.
    ValueError
        There are fewer than 20 draws, one is no such process, or the probability is out of range.
    """
    draws = np.asarray(draws, dtype=float)
    names = [item.name for item in fields(process)]
    if draws.ndim != 2 or draws.shape[1] != len(names) or draws.shape[0] < FEWEST:
        raise ValueError(
            f"draws must be at least {FEWEST} rows of {', '.join(names)}, got {draws.shape}"
        )
    if not 0.5 <= probability <= 1:
        raise ValueError(f"probability must lie within 0.5 and 1, got {probability}")
    plants = tuple(_drawn(process, dict(zip(names, row, strict=True))) for row in draws.tolist())
    if any(plant.K * process.K < 0 for plant in plants):
        raise ValueError("draws of K have both signs: no controller serves both")
    search = Search.of(process, limits, structure, N, sample_time)
    may_miss = int(len(plants) * (1 - probability) + 1e-9)
    judge = Judge(
        plants=plants,
        limits=limits,
        sample_time=sample_time,
        allowed=may_miss / len(plants),
        model=process,
    )
    best = search.best(_on_grid([process], search), objective)
    active: list[int] = []
    for _ in range(LOOKS):
        order = np.argsort(-judge.severity(best[0]))
        edge = [int(i) for i in order[may_miss : may_miss + EDGE] if int(i) not in active]
        if not edge:
            break
        active = [*active, *edge]
        grid = _on_grid([process, *(plants[i] for i in active)], search)
        best = search.best(grid, objective)
        if np.count_nonzero(judge.severity(best[0]) > 1) <= may_miss:
            break
    settings = search.settle(best, judge, objective)
    missed = int(np.count_nonzero(~judge.holds(settings.pid, np.array([settings.pid.Kc]))))
    n = len(plants)
    return DrawOptimum(
        settings=settings,
        draws=n,
        missed=missed,
        probability=1 - missed / n,
        at_least=float(beta.ppf(1 - CONFIDENCE, n - missed, missed + 1)),
    )


def _drawn(process: LagProcess, values: dict[str, float]) -> LagProcess:
    """A draw as a process of the model's kind, the longer time constant first."""
    if isinstance(process, SOPDT):
        values |= {
            "tau1": max(values["tau1"], values["tau2"]),
            "tau2": min(values["tau1"], values["tau2"]),
        }
    return type(process)(**values)


def _on_grid(processes: list[Process], search: Search) -> PlantSet:
    return PlantSet.of(processes, search.speed, hold=search.hold)


def _corners(process: Process, sizes: dict[str, float]) -> list[Process]:
    """The model, and it with every time constant at an end of its interval."""
    lags = [e for name, e in sizes.items() if name not in ("K", "theta")]
    ends = product(*(sorted({1 - e, 1 + e}) for e in lags)) if any(lags) else ()
    return [process, *(moved_plant(process, 1.0, np.array(f), process.theta) for f in ends)]


def _at_the_ends(plants: list[Process], sizes: dict[str, float]) -> list[Process]:
    """Each plant with its gain and its dead time at both ends, of a general one the upper ends.

    Those are judged one by one; what they leave out the proof finds.
    """
    few = isinstance(plants[0], TransferFunction)
    gains, late = (
        [1 + sizes[name]] if few else sorted({1 - sizes[name], 1 + sizes[name]})
        for name in ("K", "theta")
    )
    return [
        moved_plant(plant, gain, np.ones(2), factor * plant.theta)
        for plant in plants
        for gain in gains
        for factor in late
    ]


def _tightened(limits: LoopLimits) -> LoopLimits:
    """Limits a little inside those asked for; the effort as it is."""
    return replace(
        limits,
        Ms=1 + (limits.Ms - 1) * (1 - ROOM),
        Mt=1 + (limits.Mt - 1) * (1 - ROOM),
        gain=limits.gain * (1 + ROOM),
        phase=limits.phase * (1 + 0.4 * ROOM),
        delay_over_theta=limits.delay_over_theta * (1 + ROOM),
    )
