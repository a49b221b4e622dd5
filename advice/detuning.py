"""Settings by one knob from calm to fast, or by a gain, with what they keep and what they cost.

The command line, the REST service and a notebook all call this:

    from advice.detuning import detuning_case
    case = detuning_case(FOPDT(K=2, tau=120, theta=30), "calm")
"""

from dataclasses import dataclass

from advice.body import Body, process_body, profile_body, settings_body
from advice.case_body import verification_body
from advice.display import digits, margins_words, settings_words
from advice.robust_body import optimum_body
from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT, Process
from tuning.amigo_detuning import detuned_amigo_pi
from tuning.detuning import NAMED, Front, detuned, front
from tuning.optimal_search import OptimalSettings, Structure
from tuning.profiles import DEFAULT_PROFILE, Profile, profile_named
from tuning.rule import STATUS_TEXT
from tuning.verification import Verification, verify

FRONT_POINTS = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetunedAmigo:
    """AMIGO PI with a gain of one's own.

    Attributes
    ----------
    pid : PID
        Settings.
    verification : Verification
        What they keep.
    """

    pid: PID
    verification: Verification


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetuningCase:
    """Settings at one position of the knob, the whole front, and AMIGO at a stated gain.

    Attributes
    ----------
    process : Process
        Process model.
    profile : Profile
        Limits that the settings were held to.
    knob : float
        Position, 0 calm to 1 fast. [-]
    chosen : OptimalSettings
        Settings of least load area at the Ms of that position.
    verification : Verification or None
        What they keep for ±50 %; None for a process whose parameters have no names.
    front : Front
        From calm to fast.
    amigo : DetunedAmigo or None
        AMIGO PI at the stated gain, if one was.
    """

    process: Process
    profile: Profile
    knob: float
    chosen: OptimalSettings
    verification: Verification | None
    front: Front
    amigo: DetunedAmigo | None


def detuning_case(
    process: Process,
    knob: float | str = "normal",
    *,
    structure: Structure = "PI",
    gain: float | None = None,
    profile: str = DEFAULT_PROFILE,
    scan_time: float = 0.0,
) -> DetuningCase:
    """Choose settings by one knob, and lay the whole trade out.

    Parameters
    ----------
    process : Process
        Process model.
    knob : float or str
        0 to 1, or "calm", "normal", "fast". [-]
    structure : str
        PI or PID.
    gain : float, optional
        Gain that an AMIGO PI is to be detuned to, for FOPDT and IPDT. [OP/PV]
    profile : str
        Name of the profile to hold the settings to.
    scan_time : float
        Scan time of the controller. [s]

    Raises
    ------
    RuleNotApplicable
        No settings reach the position, or AMIGO cannot be detuned so.
    ValueError
        A number cannot be.
    """
    limits = profile_named(profile)
    chosen = detuned(process, knob, structure=structure, sample_time=scan_time)
    amigo = None
    if gain is not None:
        if not isinstance(process, FOPDT | IPDT):
            raise RuleNotApplicable(
                "Detuned AMIGO PI", f"it takes FOPDT or IPDT, not {type(process).__name__}"
            )
        pid = detuned_amigo_pi(process, gain)
        amigo = DetunedAmigo(
            pid=pid, verification=verify(process, pid, limits, sample_time=scan_time)
        )
    return DetuningCase(
        process=process,
        profile=limits,
        knob=NAMED[knob] if isinstance(knob, str) else knob,
        chosen=chosen,
        verification=_verified(process, chosen.pid, limits, scan_time),
        front=front(process, structure=structure, points=FRONT_POINTS, sample_time=scan_time),
        amigo=amigo,
    )


def _verified(
    process: Process, pid: PID, profile: Profile, scan_time: float
) -> Verification | None:
    try:
        return verify(process, pid, profile, sample_time=scan_time)
    except RuleNotApplicable:
        return None


def detuning_body(case: DetuningCase) -> Body:
    """The case as the JSON document of command line and API."""
    kept, amigo = case.verification, case.amigo
    return {
        "process": process_body(case.process),
        "profile": profile_body(case.profile),
        "structure": case.front.structure,
        "knob": case.knob,
        "settings": optimum_body(case.chosen),
        "verification": None if kept is None else verification_body(kept),
        "front": [
            {"knob": knob, **optimum_body(point)}
            for knob, point in zip(case.front.knob, case.front.points, strict=True)
        ],
        "amigo": None
        if amigo is None
        else {
            "settings": settings_body(amigo.pid),
            "status": "memory",
            **verification_body(amigo.verification),
        },
        "sentences": list(detuning_sentences(case)),
    }


def detuning_sentences(case: DetuningCase) -> list[str]:
    """The case in words."""
    sentences = [
        f"Knob at {case.knob:g}: {settings_words(case.chosen.pid)}; load IAE "
        f"{digits(case.chosen.load_IAE)}, {margins_words(case.chosen.margins)}."
    ]
    if case.verification is not None:
        sentences.append(case.verification.verdict)
    sentences += [
        f"From calm to fast, {knob:g}: Ms {digits(point.margins.Ms, 3)}, load IAE "
        f"{digits(point.load_IAE)}, Kc {digits(point.pid.Kc)}."
        for knob, point in zip(case.front.knob, case.front.points, strict=True)
    ]
    if case.amigo is not None:
        sentences += [
            f"AMIGO PI detuned to that gain: {settings_words(case.amigo.pid)}; "
            f"{margins_words(case.amigo.verification.nominal)}. The rule is "
            f"{STATUS_TEXT['memory']}; both of its branches are derived.",
            case.amigo.verification.verdict,
        ]
    return sentences
