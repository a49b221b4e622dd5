"""One grade per loop and period."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from monitoring.basis import Confidence
from monitoring.indices import ControlIndices, Indices
from monitoring.score_profile import ScoreProfile


class GradeWord(StrEnum):
    """The grade in a word."""

    GOOD = "good"
    FAIR = "fair"
    POOR = "poor"
    NOT_ASSESSABLE = "not assessable"


@dataclass(frozen=True, slots=True, kw_only=True)
class PartScore:
    """One part of the grade.

    Attributes
    ----------
    part : str
        Its name.
    weight : float
        Its weight in the profile. [-]
    points : float or None
        0 to 100, None where it is not known; its weight then goes to the others. [-]
    """

    part: str
    weight: float
    points: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Grade:
    """One grade per loop and period.

    Attributes
    ----------
    word : GradeWord
        Good from 75 points, fair from 50, poor below.
    points : float or None
        0 to 100. [-]
    parts : tuple of PartScore
        Where they come from.
    confidence : Confidence
        By how much of the weight is known: high from 80 %, medium from 50 %.
    profile : str
        Profile whose weights and limits were used.
    """

    word: GradeWord
    points: float | None
    parts: tuple[PartScore, ...]
    confidence: Confidence
    profile: str


def ungraded(profile: ScoreProfile) -> Grade:
    """Say that there is no grade."""
    return Grade(
        word=GradeWord.NOT_ASSESSABLE,
        points=None,
        parts=(),
        confidence=Confidence.NONE,
        profile=profile.name,
    )


def grade(indices: Indices, profile: ScoreProfile) -> Grade:
    """Weigh the parts that are known.

    Use counts the service factor, saturation its share over twice its limit, the error its
    standard deviation over its limit, oscillation its part of the variance, the valve one minus
    the probability of stiction, performance the minimum-variance index where it may be compared.
    No loop gets more points than the part of the time in which it could control at all.

    Parameters
    ----------
    indices : Indices
        Every index of the loop.
    profile : ScoreProfile
        Weights and limits for its kind.
    """
    points = _points(indices, profile)
    parts = tuple(
        PartScore(part=part, weight=weight, points=points[part]) for part, weight in profile.weights
    )
    known = [(p.weight, p.points) for p in parts if p.points is not None and p.weight > 0]
    weight = sum(w for w, _ in known)
    if weight < 0.25:
        return ungraded(profile)
    total = min(sum(w * p for w, p in known) / weight, 100 * _able(indices, profile))
    high, medium = weight >= 0.8, weight >= 0.5
    return Grade(
        word=GradeWord.GOOD if total >= 75 else GradeWord.FAIR if total >= 50 else GradeWord.POOR,
        points=total,
        parts=parts,
        confidence=Confidence.HIGH if high else Confidence.MEDIUM if medium else Confidence.LOW,
        profile=profile.name,
    )


def _able(indices: Indices, profile: ScoreProfile) -> float:
    """Part of the time in automatic, off the limits and with a PV that tells something.

    A loop that never was in automatic has no saturation to be praised for.
    """
    usage, sensor = indices.usage, indices.sensor
    lost = [
        1 - sensor.good,
        0.0 if usage.service_factor is None else 1 - usage.service_factor,
        usage.saturated or 0.0,
        float(usage.travel == 0),
        sensor.flat_share or 0.0 if sensor.frozen else 0.0,
        sensor.clipped or 0.0 if (sensor.clipped or 0.0) > profile.clipped_most else 0.0,
    ]
    return 1 - max(lost)


def _points(indices: Indices, profile: ScoreProfile) -> dict[str, float | None]:
    saturated, sd = indices.usage.saturated, indices.error.sd_percent
    return {
        "use": _percent(indices.usage.service_factor),
        "saturation": None
        if saturated is None
        else _percent(1 - saturated / (2 * profile.saturated_most)),
        "error": None if sd is None else _percent(1 - sd / profile.error_sd_percent_most),
        **_control_points(indices.control),
    }


def _control_points(control: ControlIndices | None) -> dict[str, float | None]:
    if control is None:
        return {"oscillation": None, "valve": None, "performance": None}
    probability = control.stiction.probability
    best = control.minimum_variance
    return {
        "oscillation": None
        if control.oscillation.basis.refused
        else _percent(1 - sum(c.share for c in control.oscillation.components)),
        "valve": None if probability is None else _percent(1 - probability),
        "performance": _percent(best.eta) if best.comparable and not best.extended else None,
    }


def _percent(part: float | None) -> float | None:
    return None if part is None else float(np.clip(100 * part, 0, 100))
