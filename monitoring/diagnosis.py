"""From indices to a cause, how sure that is, and what to do next."""

from monitoring.basis import Confidence
from monitoring.before_control import (
    bad_sensor,
    constrained,
    never_free,
    not_in_use,
    output_at_rest,
    valve_size_said,
)
from monitoring.cause import MOVE_IT, Action, Cause, Diagnosis, not_assessable
from monitoring.expected_response import Departure
from monitoring.indices import ControlIndices, Indices, ModelIndices
from monitoring.loop_signals import LoopKind
from monitoring.model_mismatch import ModelVerdict
from monitoring.oscillation import OscillationComponent
from monitoring.score_profile import ScoreProfile
from monitoring.set_point_moves import SetPointMoves
from monitoring.stiction_result import Stiction, StictionVerdict

# What is left of the autocorrelation of a steady wave; noise in a lively loop loses its phase.
STEADY_WAVE = 0.85
# The probability of stiction takes sticking and other valves as equally likely beforehand. Where
# one valve in four sticks, 0.75 of it is an even chance: worth a look, and no more.
RATHER_STICKS = 0.75
# Decay ratio of the autocorrelation from which tuning is left open: 8 % of simulated healthy loops
# are beyond, and 46 % of those tuned too tight.
RATHER_LIVELY = 0.35
OSCILLATING_SET_POINT = (
    "The set point swings with that period too, {ratio:.2g} times as far as the error: "
    "look at what moves it."
)
# Of at least so many set-point moves, so large a part never gets there: the loop is slow.
FEWEST_MOVES, NEVER_THERE = 3, 2 / 3


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
            not_in_use(indices, profile),
            bad_sensor(indices, profile),
            constrained(indices, profile),
            output_at_rest(indices),
        )
        if diagnosis is not None
    ]
    if indices.control is not None:
        found += _control(indices.control, profile)
    elif not found:
        return not_assessable(never_free(indices))
    if not found and indices.control is not None and indices.control.oscillation.basis.refused:
        reasons = "; ".join(indices.control.oscillation.basis.reasons)
        return not_assessable(f"Whether the loop oscillates cannot be told: {reasons}.")
    if not found and indices.control is not None and _rather_sticks(indices.control.stiction):
        return _rather_valve(indices.control.stiction)
    if not found:
        return _healthy(indices, profile)
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
    if not found and profile.kind is not LoopKind.AVERAGING_LEVEL:
        found += _never_there(control.set_point_moves)
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


def _never_there(moves: SetPointMoves) -> list[Diagnosis]:
    """Set-point moves that PV had not followed when the next one came."""
    count = len(moves.responses)
    missed = sum(response.rise_time is None for response in moves.responses)
    if count < FEWEST_MOVES or missed < NEVER_THERE * count:
        return []
    return [
        Diagnosis(
            cause=Cause.TUNING,
            confidence=Confidence.LOW,
            evidence=(
                f"PV had not come through 90 % of {missed} of {count} set-point moves when the "
                "next one came: the loop is sluggish, or its set point moves too soon.",
            ),
            action=Action.RETUNE,
        )
    ]


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


def _rather_sticks(stiction: Stiction) -> bool:
    undecided = stiction.verdict is StictionVerdict.UNDECIDED
    return undecided and (stiction.probability or 0.0) >= RATHER_STICKS


def _rather_valve(stiction: Stiction) -> Diagnosis:
    """Nothing else is found, and the valve is likelier to stick than not, without proof."""
    doubts = "; ".join(stiction.basis.reasons)
    return Diagnosis(
        cause=Cause.VALVE,
        confidence=Confidence.LOW,
        evidence=(
            f"Probability of stiction {stiction.probability:.2f}, which does not decide it: "
            f"{doubts}.",
            MOVE_IT,
        ),
        action=Action.CHECK_VALVE,
    )


def _oscillating(control: ControlIndices, main: OscillationComponent) -> Diagnosis:
    """An oscillation without stiction: from the set point, from outside, or from the tuning."""
    evidence = [f"Oscillates with a period of {main.period:.3g} s for {main.cycles:.0f} cycles."]
    undecided = control.stiction.verdict is StictionVerdict.UNDECIDED
    if undecided:
        evidence.append("Whether the valve sticks is undecided.")
    line = control.set_point_line
    others = (Cause.VALVE,) if undecided else ()
    if line is not None and line.drives:
        evidence.append(OSCILLATING_SET_POINT.format(ratio=line.ratio))
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


def _healthy(indices: Indices, profile: ScoreProfile) -> Diagnosis:
    control = indices.control
    confidence = control.oscillation.basis.confidence if control is not None else Confidence.LOW
    evidence = ["In use, no oscillation found, the output free to move."]
    undecided = control is not None and control.stiction.verdict is StictionVerdict.UNDECIDED
    if undecided:
        evidence.append("Whether the valve sticks is undecided. " + MOVE_IT)
        confidence = Confidence.MEDIUM if confidence is Confidence.HIGH else Confidence.LOW
    lively = control is not None and control.acf_decay.ratio >= RATHER_LIVELY
    if control is not None and lively:
        evidence.append(
            f"The autocorrelation of the error decays with {control.acf_decay.ratio:.2f} a period, "
            "as it seldom does in well-tuned loops: the gain may be too high, or the load swings."
        )
        confidence = Confidence.MEDIUM if confidence is Confidence.HIGH else Confidence.LOW
    if control is not None and indices.error.basis.refused:
        evidence.append("The error is not known: no set point was recorded.")
        confidence = Confidence.LOW
    sd, most = indices.error.sd_percent, profile.error_sd_percent_most
    if sd is not None and sd >= most:
        evidence.append(
            f"But the error's standard deviation of {sd:.2g} % of span is beyond the {most:g} % "
            f"that this kind of loop is graded by, and nothing found here explains it."
        )
        confidence = Confidence.LOW
    evidence += valve_size_said(indices)
    return Diagnosis(
        cause=Cause.HEALTHY,
        confidence=confidence,
        evidence=tuple(evidence),
        action=Action.NOTHING,
        others=(*((Cause.VALVE,) if undecided else ()), *((Cause.TUNING,) if lively else ())),
    )
