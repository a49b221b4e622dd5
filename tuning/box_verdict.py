"""Whether a profile holds for every plant of a box: a proof, a plant that breaks it, or neither."""

from dataclasses import dataclass

import numpy as np

from loop.controller import PID
from loop.margins import Margins
from loop.process import Process
from loop.signals import Real
from tuning.box_bounds import MARGINS
from tuning.box_case import UNSTABLE, BoxCase, badness_of, margins_of, plant_words
from tuning.box_proof import DEFAULT_ERRORS, MOST_CELLS
from tuning.box_search import search_box
from tuning.profiles import Profile
from tuning.uncertain_loop import Errors


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoxVerdict:
    """Whether a profile holds over a whole box.

    Attributes
    ----------
    holds : bool or None
        True: proven. False: `plant` breaks it. None: undecided within the budget.
    plant : Process or None
        The plant that breaks it.
    sentence : str
        The answer in words.
    cells : int
        Cells that were bounded.
    """

    holds: bool | None
    plant: Process | None
    sentence: str
    cells: int


def hold_box(
    process: Process,
    controller: PID,
    profile: Profile,
    *,
    errors: Errors = DEFAULT_ERRORS,
    sample_time: float = 0.0,
    most_cells: int = MOST_CELLS,
) -> BoxVerdict:
    """Decide whether a profile holds for every plant of a box; faster than bounding everything.

    Parameters
    ----------
    process : Process
        Model, middle of the box.
    controller : PID
        Settings as they will run.
    profile : Profile
        Limits on the margins.
    errors : tuple of float or mapping of str to float
        Relative errors of (K, tau, theta), or by name. [-]
    sample_time : float
        Scan time; half of it counts as dead time. [s]
    most_cells : int
        Budget of cells.

    Raises
    ------
    ValueError
        As `prove_box`.
    """
    case = BoxCase.of(process, controller, errors, sample_time)
    limits = case.limits(profile)
    tried = case.seeds()
    broken = case.broken(tried, limits)
    cells = 0
    if broken is None:
        search = search_box(
            case.loop,
            np.array([badness_of(found) for _, found in tried]).max(axis=0),
            tolerance=0.0,
            limits=limits,
            most_cells=most_cells,
            stop_at=limits,
        )
        cells = search.cells
        met, unstable = case.met(search)
        broken = (unstable, UNSTABLE) if unstable else case.broken(met, limits)
        if broken is None and not np.all(search.bound <= limits):
            sentence = f"undecided within {cells} cells"
            return BoxVerdict(holds=None, plant=None, sentence=sentence, cells=cells)
    if broken is None:
        sentence = f"the {profile.name} profile holds over the whole box ({cells} cells)"
        return BoxVerdict(holds=True, plant=None, sentence=sentence, cells=cells)
    plant, found = broken
    return BoxVerdict(
        holds=False, plant=plant, sentence=_broken_words(plant, found, limits), cells=cells
    )


def _broken_words(plant: Process, found: Margins, limits: Real) -> str:
    if found is UNSTABLE:
        return f"the loop is unstable with {plant_words(plant)}"
    have, asked = margins_of(badness_of(found)), margins_of(limits)
    over = badness_of(found) / np.where(limits > 0, limits, np.inf)
    name = MARGINS[int(np.argmax(over))]
    title = {"gain": "the gain margin", "phase": "the phase margin", "delay": "the delay margin"}
    unit = {"phase": "°", "delay": " s"}.get(name, "")
    side = "above" if name in ("Ms", "Mt") else "below"
    return (
        f"{title.get(name, name)} is {have[name]:.5g}{unit} with {plant_words(plant)}, "
        f"{side} {asked[name]:.5g}{unit}"
    )
