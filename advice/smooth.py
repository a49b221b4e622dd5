"""The slowest settings that a load permits, verified and simulated.

The command line, the REST service and a notebook all call this:

    from advice.smooth import smooth_case
    case = smooth_case(FOPDT(K=2, tau=120, theta=30), load=5, allowed=20)
"""

from dataclasses import dataclass

from advice.body import Body, number, process_body, profile_body, settings_body
from advice.case_body import verification_body
from advice.display import digits, settings_words
from advice.horizon import horizon
from loop.errors import RuleNotApplicable
from loop.measures import load_measures
from loop.process import IPDT, Process, static_gain
from loop.simulation import simulate
from tuning.profiles import DEFAULT_PROFILE, Profile, profile_named
from tuning.smooth import SlowestSettings, averaging_level, smooth_simc
from tuning.verification import Verification, verify

FINE = 4000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlowChoice:
    """One way to be as slow as the load permits.

    Attributes
    ----------
    name : str
        "smooth" or "averaging level".
    found : SlowestSettings or None
        Settings; None where the way is closed.
    refusal : str
        Why it is closed; empty where it is not.
    verification : Verification or None
        What the settings keep.
    peak : float or None
        Deviation of PV after the load step, simulated. [PV]
    """

    name: str
    found: SlowestSettings | None
    refusal: str = ""
    verification: Verification | None = None
    peak: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SmoothCase:
    """The slowest settings for a load.

    Attributes
    ----------
    process : Process
        Process model.
    load, allowed : float
        Largest load at the process input, and the deviation of PV that may be. [OP], [PV]
    profile : Profile
        Limits that the settings were held to.
    choices : tuple of SlowChoice
        Smooth tuning, and for an integrator averaging level control.
    """

    process: Process
    load: float
    allowed: float
    profile: Profile
    choices: tuple[SlowChoice, ...]


def smooth_case(
    process: Process, *, load: float, allowed: float, profile: str = DEFAULT_PROFILE
) -> SmoothCase:
    """Tune as slowly as a load permits, verify the settings and simulate the load.

    Parameters
    ----------
    process : FOPDT, SOPDT, IPDT or TransferFunction
        Process model; a transfer function must be K/(s (tau2 s + 1)). [s]
    load : float
        Largest load step, as the output it takes to balance it. [OP]
    allowed : float
        Largest deviation of PV that is allowed. [PV]
    profile : str
        Name of the profile to hold the settings to.

    Raises
    ------
    RuleNotApplicable
        No way is open; the sentence has the deviation that could be held.
    ValueError
        A number cannot be.
    """
    limits = profile_named(profile)
    choices = [_choice("smooth", process, load, allowed, limits)]
    if isinstance(process, IPDT):
        choices.append(_choice("averaging level", process, load, allowed, limits))
    if all(choice.found is None for choice in choices):
        title, _, reason = choices[0].refusal.partition(" does not apply: ")
        others = [choice.refusal.rstrip(".") for choice in choices[1:]]
        raise RuleNotApplicable(title, "; ".join([reason.rstrip("."), *others]))
    return SmoothCase(
        process=process, load=load, allowed=allowed, profile=limits, choices=tuple(choices)
    )


def _choice(
    name: str, process: Process, load: float, allowed: float, profile: Profile
) -> SlowChoice:
    tune = smooth_simc if name == "smooth" else averaging_level
    try:
        found = tune(process, load=load, allowed=allowed)
    except RuleNotApplicable as reason:
        return SlowChoice(name=name, found=None, refusal=str(reason))
    t_end, dt = horizon(process, [found.pid])
    # A scan adds half of itself to the dead time, and to the peak what comes in meanwhile.
    run = simulate(process, found.pid, t_end=t_end, dt=min(dt, t_end / FINE), load=load)
    measures = load_measures(run.t, run.pv, run.op, sp=0.0, op_before=0.0)
    return SlowChoice(
        name=name,
        found=found,
        verification=verify(process, found.pid, profile),
        peak=abs(measures.peak_deviation),
    )


def smooth_body(case: SmoothCase) -> Body:
    """The slowest settings as the JSON document of command line and API."""
    return {
        "process": process_body(case.process),
        "load": case.load,
        "allowed": case.allowed,
        "profile": profile_body(case.profile),
        "choices": [_choice_body(choice) for choice in case.choices],
        "sentences": list(smooth_sentences(case)),
    }


def _choice_body(choice: SlowChoice) -> Body:
    found, kept = choice.found, choice.verification
    if found is None or kept is None:
        return {"name": choice.name, "settings": None, "refusal": choice.refusal}
    return {
        "name": choice.name,
        "settings": settings_body(found.pid),
        "refusal": None,
        "tau_c": found.tau_c,
        "reason": found.sentence,
        "peak": number(choice.peak),
        **verification_body(kept),
    }


def smooth_sentences(case: SmoothCase) -> list[str]:
    """The slowest settings in words."""
    sentences = []
    moved = abs(static_gain(case.process)) * case.load
    if moved <= case.allowed:
        sentences.append(
            f"Without control that load moves PV by {digits(moved, 3)}, within what is allowed."
        )
    for choice in case.choices:
        title = choice.name[0].upper() + choice.name[1:]
        if choice.found is None or choice.verification is None:
            sentences.append(f"{title}: {choice.refusal}")
            continue
        sentences += [
            f"{title}: {settings_words(choice.found.pid)} (tau_c = "
            f"{digits(choice.found.tau_c, 4)} s): {choice.found.sentence}.",
            f"Simulated, a load step of {case.load:g} moves PV by {digits(choice.peak, 3)}, of "
            f"{case.allowed:g} allowed.",
            choice.verification.verdict,
        ]
    return sentences
