"""Proof of the worst margins over a whole box of plants, not over its corners.

Gain, time constants and dead time are anywhere within their errors, all at once. Every margin
comes with a plant that was found and with a bound that no plant of the box passes.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from loop.controller import PID
from loop.process import Process
from tuning.box_bounds import MARGINS
from tuning.box_case import UNSTABLE, BoxCase, Tried, badness_of, margins_of, plant_words
from tuning.box_search import Search, search_box
from tuning.uncertain_loop import Errors

# Cells are cut until bound and plant are this close.
TOLERANCE = 0.008
MOST_CELLS = 200_000
DEFAULT_ERRORS = (0.5, 0.5, 0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstCase:
    """The worst value of one margin over a box.

    Attributes
    ----------
    found : float
        The worst value met, at `plant`. Gain, Ms, Mt in [-], phase in [deg], delay in [s].
    bound : float
        Value that no plant of the box passes: a lower bound of gain, phase and delay margin, an
        upper bound of Ms and Mt.
    plant : Process
        Where the worst value was met.
    """

    found: float
    bound: float
    plant: Process

    @property
    def gap(self) -> float:
        """How far bound and plant are apart, relative to the plant. [-]"""
        if self.found == self.bound:
            return 0.0
        return abs(self.bound - self.found) / self.found if self.found else math.inf


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoxProof:
    """Worst margins over a box of plants.

    Attributes
    ----------
    process : Process
        The model, middle of the box.
    controller : PID
        Settings.
    errors : mapping of str to float
        Relative error of each parameter. [-]
    sample_time : float
        Scan time; half of it counts as dead time. [s]
    stable : bool or None
        True: every plant of the box is stable, proven. False: `unstable_plant` is not. None: the
        budget ran out before either was shown.
    unstable_plant : Process or None
        A plant of the box whose loop is unstable or on the limit.
    worst : mapping of str to WorstCase
        Worst gain, phase, delay, Ms and Mt. With an unstable plant, that plant: 0, Ms infinite.
    cells : int
        Cells of frequency and time constants that were bounded.
    finished : bool
        Whether every bound came within the tolerance of its plant before the budget ran out.
    w_low, w_high : float
        Frequencies between which cells were laid; both ends were bounded in closed form. [rad/s]
    """

    process: Process
    controller: PID
    errors: Mapping[str, float]
    sample_time: float
    stable: bool | None
    unstable_plant: Process | None
    worst: Mapping[str, WorstCase]
    cells: int
    finished: bool
    w_low: float
    w_high: float

    @property
    def certificate(self) -> str:
        """What makes the bounds rigorous, in words."""
        moved = " x ".join(f"{name} ±{100 * e:g} %" for name, e in self.errors.items() if e)
        box = f"the box {moved}" if moved else "the model alone"
        if self.unstable_plant is not None:
            return f"An unstable plant lies in {box}: {plant_words(self.unstable_plant)}."
        if self.stable is None:
            return (
                f"Undecided: {self.cells} cells of {box} were bounded before the budget ran out; "
                "no unstable plant was found, and -1 was not excluded either."
            )
        end = "" if self.finished else " The budget ran out before the gaps closed."
        return (
            f"The model is stable, and -1 is excluded for every plant of {box} at every frequency: "
            f"{self.cells} cells from {self.w_low:.3g} to {self.w_high:.3g} rad/s, each with an "
            "interval bound on L that is exact in gain and dead time, and closed bounds beyond."
            f"{end}"
        )


def prove_box(
    process: Process,
    controller: PID,
    *,
    errors: Errors = DEFAULT_ERRORS,
    sample_time: float = 0.0,
    most_cells: int = MOST_CELLS,
) -> BoxProof:
    """Bound the worst margins over a box of plants, by branch and bound on the exact response.

    The set of loops of a box is connected, so if the model is stable and L = -1 at no frequency
    for no plant, every plant is stable (zero exclusion). For a given frequency and time constants
    the least |1 + L| over all gains and dead times has a closed form; frequency and time constants
    are cut into cells with interval bounds on ln|L| and arg L.

    Parameters
    ----------
    process : FOPDT, SOPDT, IPDT, DoubleIntegrator or TransferFunction
        Model, middle of the box. Of a TransferFunction the error of tau multiplies the time
        constants of all poles and zeros alike.
    controller : PID
        Settings as they will run.
    errors : tuple of float or mapping of str to float
        Relative errors of (K, tau, theta), or by name. [-]
    sample_time : float
        Scan time; half of it counts as dead time. [s]
    most_cells : int
        Budget. When it runs out the bounds are wider, still true, and `finished` is False.

    Raises
    ------
    ValueError
        An error, the scan time or a name is impossible, or the box leaves the range of models.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> proof = prove_box(FOPDT(K=2.0, tau=120.0, theta=30.0), PID(Kc=0.45, Ti=135.0, Td=13.3))
    >>> proof.stable, round(proof.worst["Ms"].found, 3), proof.worst["Ms"].gap < 0.01
    (True, 1.97, True)
    """
    case = BoxCase.of(process, controller, errors, sample_time)
    seeds = case.seeds()
    unstable = next((plant for plant, found in seeds if found is UNSTABLE), None)
    if unstable is not None:
        return _unstable(case, unstable, cells=0)
    start = np.array([badness_of(found) for _, found in seeds]).max(axis=0)
    search = search_box(
        case.loop,
        start,
        tolerance=TOLERANCE,
        limits=np.zeros(5),
        most_cells=most_cells,
        stop_at=np.full(5, np.inf),
    )
    more, unstable = case.met(search)
    if unstable is not None:
        return _unstable(case, unstable, cells=search.cells)
    return _proven(case, [*seeds, *more], search)


def _unstable(case: BoxCase, plant: Process, *, cells: int) -> BoxProof:
    values = margins_of(np.full(5, np.inf))
    worst = {
        name: WorstCase(found=value, bound=value, plant=plant) for name, value in values.items()
    }
    return BoxProof(
        process=case.process,
        controller=case.controller,
        errors=case.sizes,
        sample_time=case.sample_time,
        stable=False,
        unstable_plant=plant,
        worst=MappingProxyType(worst),
        cells=cells,
        finished=True,
        w_low=0.0,
        w_high=math.inf,
    )


def _proven(case: BoxCase, tried: Tried, search: Search) -> BoxProof:
    table = np.array([badness_of(found) for _, found in tried])
    at, found = np.argmax(table, axis=0), table.max(axis=0)
    values, bounds = margins_of(found), margins_of(np.maximum(search.bound, found))
    worst = {
        name: WorstCase(
            found=values[name], bound=bounds[name], plant=tried[at[MARGINS.index(name)]][0]
        )
        for name in values
    }
    return BoxProof(
        process=case.process,
        controller=case.controller,
        errors=case.sizes,
        sample_time=case.sample_time,
        stable=True if np.isfinite(search.bound[0]) else None,
        unstable_plant=None,
        worst=MappingProxyType(worst),
        cells=search.cells,
        finished=search.finished,
        w_low=search.w_low,
        w_high=search.w_high,
    )
