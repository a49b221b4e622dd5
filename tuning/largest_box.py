"""The largest model error that a profile survives, with all parameters off at once."""

from dataclasses import dataclass

from loop.controller import PID
from loop.process import Process
from tuning.box_proof import MOST_CELLS
from tuning.box_verdict import BoxVerdict, hold_box
from tuning.profiles import Profile
from tuning.uncertain_loop import error_sizes

# Errors are halved down to this; a plant that is off by all of its gain is no plant.
RESOLUTION, LARGEST_ERROR = 0.005, 0.995


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LargestBox:
    """How far all parameters may be off at once.

    Attributes
    ----------
    profile : Profile
        Limits that hold inside.
    holds : float
        Largest relative error of every parameter for which the profile is proven; 0 where it does
        not hold at the model. [-]
    fails : float or None
        Smallest error for which it is not proven; None where it holds up to 99.5 %. [-]
    plant : Process or None
        A plant within `fails` that breaks the profile; None where there is no `fails`, or where
        neither a proof nor a plant was found in the budget.
    sentence : str
        The answer in words.
    """

    profile: Profile
    holds: float
    fails: float | None
    plant: Process | None
    sentence: str


def largest_box(
    process: Process,
    controller: PID,
    profile: Profile,
    *,
    sample_time: float = 0.0,
    most_cells: int = MOST_CELLS,
) -> LargestBox:
    """Find the largest +-x % box of all parameters over which a profile is proven.

    Boxes lie one in the other, so the proof is bisected, to half a percent.

    Parameters
    ----------
    process : Process
        Model, middle of the boxes.
    controller : PID
        Settings as they will run.
    profile : Profile
        Limits on the margins.
    sample_time : float
        Scan time; half of it counts as dead time. [s]
    most_cells : int
        Budget of each proof.

    Raises
    ------
    ValueError
        The scan time is impossible.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> from tuning.profiles import PROFILES
    >>> heater = FOPDT(K=2.0, tau=120.0, theta=30.0)
    >>> found = largest_box(heater, PID(Kc=0.6, Ti=120.0), PROFILES["general"])
    >>> 0.3 < found.holds < found.fails < 0.5
    True
    """
    names = [name for name in error_sizes(process, {}) if name != "theta" or process.theta > 0]

    def at(error: float) -> BoxVerdict:
        return hold_box(
            process,
            controller,
            profile,
            errors=dict.fromkeys(names, error),
            sample_time=sample_time,
            most_cells=most_cells,
        )

    model = at(0.0)
    if not model.holds:
        return LargestBox(
            profile=profile,
            holds=0.0,
            fails=0.0,
            plant=model.plant,
            sentence=f"The {profile.name} profile is not proven at the model: {model.sentence}.",
        )
    widest = at(LARGEST_ERROR)
    if widest.holds:
        return LargestBox(
            profile=profile,
            holds=LARGEST_ERROR,
            fails=None,
            plant=None,
            sentence=f"The {profile.name} profile holds up to ±99.5 % of every parameter.",
        )
    low, high = 0.0, LARGEST_ERROR
    while high - low > RESOLUTION:
        middle = 0.5 * (low + high)
        verdict = at(middle)
        if verdict.holds:
            low = middle
        else:
            high, widest = middle, verdict
    return LargestBox(
        profile=profile,
        holds=low,
        fails=high,
        plant=widest.plant,
        sentence=(
            f"The {profile.name} profile is proven for ±{100 * low:.1f} % of every parameter at "
            f"once; at ±{100 * high:.1f} % {widest.sentence}."
        ),
    )
