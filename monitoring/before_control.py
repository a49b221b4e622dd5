"""Causes that lie before control: not in use, the measurement, the range of the valve."""

from monitoring.basis import Confidence
from monitoring.cause import MOVE_IT, Action, Cause, Diagnosis
from monitoring.indices import Indices
from monitoring.loop_signals import FEWEST_SAMPLES
from monitoring.score_profile import ScoreProfile
from monitoring.valve_size import ValveSize


def not_in_use(indices: Indices, profile: ScoreProfile) -> Diagnosis | None:
    """Find a loop that is in automatic too seldom."""
    service = indices.usage.service_factor
    if service is None or service >= profile.service_factor_least:
        return None
    return Diagnosis(
        cause=Cause.NOT_IN_USE,
        confidence=Confidence.HIGH,
        evidence=(f"In automatic for {service:.0%} of the time with a known mode.",),
        action=Action.ASK_OPERATORS,
    )


def never_free(indices: Indices) -> str:
    """Say why control cannot be judged at all."""
    changes = indices.usage.mode_changes
    often = f"; the mode changes {changes:.0f} times a day" if changes else ""
    return (
        f"The controller was never in automatic, known and off its limits for {FEWEST_SAMPLES} "
        f"samples in a row{often}."
    )


def output_at_rest(indices: Indices) -> Diagnosis | None:
    """Find an output that never moves under a PV that does; at a limit that is a constraint."""
    if indices.control is None or indices.usage.travel != 0:
        return None
    return Diagnosis(
        cause=Cause.NOT_IN_USE,
        confidence=Confidence.MEDIUM,
        evidence=(
            "OP kept one value all the time although PV moved: the controller does not act, "
            "whatever its mode says, or the OP that was recorded is not its own.",
        ),
        action=Action.ASK_OPERATORS,
    )


def bad_sensor(indices: Indices, profile: ScoreProfile) -> Diagnosis | None:
    """Find a measurement that is frozen, clipped, coarse or often missing."""
    sensor = indices.sensor
    evidence = []
    if sensor.frozen:
        evidence.append(f"PV stood still for {sensor.longest_flat:.4g} s while OP moved.")
        if sensor.noise:
            evidence.append("Its noise stopped too, which speaks for the measurement.")
    if sensor.clipped is not None and sensor.clipped > profile.clipped_most:
        evidence.append(
            f"{sensor.clipped:.0%} of PV rest at its highest or lowest value, as if clipped."
        )
    if sensor.coarse:
        evidence.append(
            f"PV moves in steps of {sensor.resolution:.3g}, more than its own standard deviation."
        )
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


def constrained(indices: Indices, profile: ScoreProfile) -> Diagnosis | None:
    """Find an output that stands at a limit too often."""
    usage = indices.usage
    low, high, both = usage.saturated_low, usage.saturated_high, usage.saturated
    if low is None or high is None or both is None or both <= profile.saturated_most:
        return None
    end = "upper" if high > low else "lower"
    return Diagnosis(
        cause=Cause.CONSTRAINT,
        confidence=Confidence.HIGH,
        evidence=(
            f"OP stood at a limit for {both:.0%} of the time, mostly the {end} one.",
            *valve_size_said(indices),
        ),
        action=Action.CHECK_RANGE,
    )


def valve_size_said(indices: Indices) -> list[str]:
    """Say where OP lies if that is not what a valve was made for."""
    found = indices.valve_range
    if found.middle is None or found.size not in (ValveSize.OVERSIZED, ValveSize.UNDERSIZED):
        return []
    where = "lowest" if found.size is ValveSize.OVERSIZED else "highest"
    return [
        f"OP stays in the {where} fifth of its range, around {found.middle:.2g} %: the valve may "
        f"be {found.size} for what it does."
    ]
