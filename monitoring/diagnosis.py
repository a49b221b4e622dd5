"""From indices to a cause, how sure that is, and what to do next."""

from dataclasses import dataclass
from enum import StrEnum

from monitoring.basis import Confidence
from monitoring.expected_response import Departure
from monitoring.indices import ControlIndices, Indices, ModelIndices
from monitoring.model_mismatch import ModelVerdict
from monitoring.oscillation import OscillationComponent
from monitoring.score_profile import ScoreProfile
from monitoring.stiction_result import StictionVerdict

# Two oscillations whose periods differ by less than this part are taken as one.
SAME_PERIOD = 0.1
# What is left of the autocorrelation of a steady wave; noise in a lively loop loses its phase.
STEADY_WAVE = 0.85
MOVE_IT = (
    "To tell: put the loop in manual, move OP by a few percent up and back, and watch PV and the "
    "stem; check the positioner."
)
OSCILLATING_SET_POINT = "The set point oscillates with the same period, about {period:.3g} s."


class Cause(StrEnum):
    """What is wrong with a loop."""

    HEALTHY = "healthy"
    VALVE = "valve"
    TUNING = "tuning"
    DISTURBANCE = "disturbance"
    SENSOR = "sensor"
    CONSTRAINT = "constraint"
    NOT_IN_USE = "not in use"
    NOT_ASSESSABLE = "not assessable"


class Action(StrEnum):
    """What to do next."""

    NOTHING = "nothing"
    CHECK_VALVE = "check the valve"
    RETUNE = "retune"
    IDENTIFY = "identify the process again, then retune"
    LOOK_UPSTREAM = "look upstream"
    CHECK_SENSOR = "check the measurement"
    CHECK_RANGE = "check the operating point and the size of the valve"
    ASK_OPERATORS = "ask why the loop is not in automatic"
    GET_DATA = "get better data"


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """What is wrong, how sure that is, and what to do.

    Attributes
    ----------
    cause : Cause
        The likeliest cause.
    confidence : Confidence
        How far to trust it.
    evidence : tuple of str
        What it rests on.
    action : Action
        What to do next.
    others : tuple of Cause
        Further causes that the data show or leave open.
    """

    cause: Cause
    confidence: Confidence
    evidence: tuple[str, ...]
    action: Action
    others: tuple[Cause, ...] = ()


def not_assessable(reason: str) -> Diagnosis:
    """Say why nothing can be said."""
    return Diagnosis(
        cause=Cause.NOT_ASSESSABLE,
        confidence=Confidence.NONE,
        evidence=(reason,),
        action=Action.GET_DATA,
    )


def diagnose(indices: Indices, profile: ScoreProfile) -> Diagnosis:
    """Name the cause that stands first: use, measurement, constraint, valve, tuning, disturbance.

    The order is that of what spoils the indices after it: a loop in manual has no tuning to
    judge, a frozen sensor no oscillation, a saturated output no performance, and a sticking
    valve no minimum variance.

    Parameters
    ----------
    indices : Indices
        Every index of the loop.
    profile : ScoreProfile
        Limits for its kind.
    """
    found = [
        diagnosis
        for diagnosis in (
            _not_in_use(indices, profile),
            _sensor(indices, profile),
            _constraint(indices, profile),
        )
        if diagnosis is not None
    ]
    if indices.control is not None:
        found += _control(indices.control, profile)
    elif not found:
        return not_assessable(
            "The controller was never in automatic, known and off its limits for long enough."
        )
    if not found:
        return _healthy(indices)
    first = found[0]
    further = (d.cause for d in found[1:] if d.cause is not first.cause)
    others = tuple(dict.fromkeys((*first.others, *further)))
    return Diagnosis(
        cause=first.cause,
        confidence=first.confidence,
        evidence=first.evidence,
        action=first.action,
        others=others,
    )


def _not_in_use(indices: Indices, profile: ScoreProfile) -> Diagnosis | None:
    service = indices.usage.service_factor
    if service is None or service >= profile.service_factor_least:
        return None
    return Diagnosis(
        cause=Cause.NOT_IN_USE,
        confidence=Confidence.HIGH,
        evidence=(f"In automatic for {service:.0%} of the time with a known mode.",),
        action=Action.ASK_OPERATORS,
    )


def _sensor(indices: Indices, profile: ScoreProfile) -> Diagnosis | None:
    sensor = indices.sensor
    evidence = []
    if sensor.frozen:
        evidence.append(f"PV stood still for {sensor.longest_flat:.4g} s while OP moved.")
        if sensor.noise:
            evidence.append("Its noise stopped too, which speaks for the measurement.")
    if sensor.clipped is not None and sensor.clipped > profile.clipped_most:
        evidence.append(f"{sensor.clipped:.0%} of PV lie clipped at an end of its range.")
    if sensor.coarse:
        evidence.append("PV moves by less than its own resolution.")
    if sensor.good < profile.good_least:
        evidence.append(f"Only {sensor.good:.0%} of PV have a good value.")
    if not evidence:
        return None
    confidence = Confidence.HIGH if len(evidence) > 1 else Confidence.MEDIUM
    if sensor.frozen:
        evidence.append("A valve that does not move looks alike. " + MOVE_IT)
    return Diagnosis(
        cause=Cause.SENSOR,
        confidence=confidence,
        evidence=tuple(evidence),
        action=Action.CHECK_SENSOR,
        # A PV that stands still while OP moves may also be a valve that does not move.
        others=(Cause.VALVE,) if sensor.frozen else (),
    )


def _constraint(indices: Indices, profile: ScoreProfile) -> Diagnosis | None:
    usage = indices.usage
    low, high, both = usage.saturated_low, usage.saturated_high, usage.saturated
    if low is None or high is None or both is None or both <= profile.saturated_most:
        return None
    end = "upper" if high > low else "lower"
    return Diagnosis(
        cause=Cause.CONSTRAINT,
        confidence=Confidence.HIGH,
        evidence=(f"OP stood at a limit for {both:.0%} of the time, mostly the {end} one.",),
        action=Action.CHECK_RANGE,
    )


def _control(control: ControlIndices, profile: ScoreProfile) -> list[Diagnosis]:
    """Causes that the control error itself shows."""
    found = []
    if control.stiction.verdict is StictionVerdict.STICTION:
        found.append(_valve(control))
    elif control.oscillation.main is not None:
        found.append(_oscillating(control, control.oscillation.main))
    elif control.load_responses.swinging and control.acf_decay.lively:
        found.append(_aggressive(control))
    loads = control.load_responses
    if loads.sluggish:
        found.append(
            Diagnosis(
                cause=Cause.TUNING,
                confidence=loads.basis.confidence,
                evidence=(f"Sluggish: idle index {loads.idle_index:.2f} beyond 0.4.",),
                action=Action.RETUNE,
            )
        )
    if control.model is not None:
        found += _by_model(control.model)
    best = control.minimum_variance
    poor = best.eta is not None and best.eta < profile.eta_least
    if poor and best.comparable and not best.extended and not found:
        found.append(
            Diagnosis(
                cause=Cause.TUNING,
                confidence=Confidence.LOW,
                evidence=(f"Minimum-variance index {best.eta:.2f} below {profile.eta_least}.",),
                action=Action.RETUNE,
                others=(Cause.DISTURBANCE,),
            )
        )
    return found


def _aggressive(control: ControlIndices) -> Diagnosis:
    """Swinging after loads, and in between: either alone is chance or the load's own shape."""
    loads, decay = control.load_responses, control.acf_decay
    return Diagnosis(
        cause=Cause.TUNING,
        confidence=Confidence.MEDIUM,
        evidence=(
            f"Aggressive: OP swings after loads, area index {loads.area_index:.2f}, and the "
            f"autocorrelation of the error decays with {decay.ratio:.2f} a period.",
        ),
        action=Action.RETUNE,
        others=(Cause.DISTURBANCE,),
    )


def _by_model(model: ModelIndices) -> list[Diagnosis]:
    """What the loop sheet and the data do not agree about."""
    found = []
    mismatch, response = model.mismatch, model.expected_response
    if mismatch.verdict is ModelVerdict.DOES_NOT:
        suspect = "" if mismatch.suspect is None else f" Its {mismatch.suspect} seems off."
        evidence = f"The model does not describe the loop, p = {mismatch.p_value:.1g}.{suspect}"
        found.append(_against_sheet(evidence, mismatch.basis.confidence, Action.IDENTIFY))
    if response.departures:
        words = ", ".join(response.departures)
        evidence = f"Set-point moves against model and settings: {words}."
        off = Departure.GAIN_OFF in response.departures
        action = Action.IDENTIFY if off or found else Action.RETUNE
        found.append(_against_sheet(evidence, response.basis.confidence, action))
    return found


def _against_sheet(evidence: str, confidence: Confidence, action: Action) -> Diagnosis:
    return Diagnosis(cause=Cause.TUNING, confidence=confidence, evidence=(evidence,), action=action)


def _valve(control: ControlIndices) -> Diagnosis:
    stiction = control.stiction
    agreeing = [e.method for e in stiction.evidence if e.verdict is StictionVerdict.STICTION]
    evidence = [f"Probability of stiction {stiction.probability:.2f}."]
    if agreeing:
        evidence.append("Alone, these say so too: " + ", ".join(agreeing) + ".")
    if stiction.S is not None and stiction.J is not None:
        evidence.append(f"S {stiction.S:.2g} % and J {stiction.J:.2g} % of OP explain OP and PV.")
    elif stiction.apparent_size is not None:
        evidence.append(f"Apparent stiction {stiction.apparent_size:.2g} % of OP.")
    evidence.append(MOVE_IT)
    return Diagnosis(
        cause=Cause.VALVE,
        confidence=stiction.basis.confidence,
        evidence=tuple(evidence),
        action=Action.CHECK_VALVE,
    )


def _oscillating(control: ControlIndices, main: OscillationComponent) -> Diagnosis:
    """An oscillation without stiction: from the set point, from outside, or from the tuning."""
    evidence = [f"Oscillates with a period of {main.period:.3g} s for {main.cycles:.0f} cycles."]
    undecided = control.stiction.verdict is StictionVerdict.UNDECIDED
    if undecided:
        evidence.append("Whether the valve sticks is undecided.")
    outer = control.set_point_oscillation
    others = (Cause.VALVE,) if undecided else ()
    if outer is not None and any(
        abs(wave.period / main.period - 1) < SAME_PERIOD for wave in outer.components
    ):
        evidence.append(OSCILLATING_SET_POINT.format(period=main.period))
        return Diagnosis(
            cause=Cause.DISTURBANCE,
            confidence=Confidence.HIGH,
            evidence=tuple(evidence),
            action=Action.LOOK_UPSTREAM,
        )
    if control.acf_decay.lively and main.decay_ratio < STEADY_WAVE:
        evidence.append(
            f"The wave loses its phase and the autocorrelation decays with "
            f"{control.acf_decay.ratio:.2f} a period: the loop itself swings."
        )
        return Diagnosis(
            cause=Cause.TUNING,
            confidence=Confidence.LOW if undecided else Confidence.MEDIUM,
            evidence=tuple(evidence),
            action=Action.RETUNE,
            others=(*others, Cause.DISTURBANCE),
        )
    evidence.append("The wave keeps its phase: something outside, or a loop at its limit, drives.")
    return Diagnosis(
        cause=Cause.DISTURBANCE,
        confidence=Confidence.LOW,
        evidence=tuple(evidence),
        action=Action.LOOK_UPSTREAM,
        others=(*others, Cause.TUNING),
    )


def _healthy(indices: Indices) -> Diagnosis:
    control = indices.control
    confidence = control.oscillation.basis.confidence if control is not None else Confidence.LOW
    evidence = ["In use, no oscillation found, the output free to move."]
    if control is not None and control.stiction.verdict is StictionVerdict.UNDECIDED:
        evidence.append("Whether the valve sticks is undecided.")
    return Diagnosis(
        cause=Cause.HEALTHY,
        confidence=confidence,
        evidence=tuple(evidence),
        action=Action.NOTHING,
    )
