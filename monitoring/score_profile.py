"""Weights and limits of the scorecard, as data files beside this one."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from monitoring.loop_signals import LoopKind

FOLDER = Path(__file__).parent / "profiles"
DEFAULT_SCORE_PROFILE = "loopwright"
PARTS = ("use", "saturation", "error", "oscillation", "valve", "performance")


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreProfile:
    """Weights and limits for one kind of loop.

    Attributes
    ----------
    name, source : str
        Name of the profile and where its numbers come from.
    kind : LoopKind
        Kind of loop.
    weights : tuple of (str, float)
        Weight of every part of the grade; they sum to 1. [-]
    service_factor_least : float
        Below it the loop counts as not in use. [-]
    saturated_most : float
        Above it the output counts as constrained. [-]
    clipped_most, good_least : float
        Limits of the measurement. [-]
    eta_least : float
        Below it the minimum-variance index counts as poor. [-]
    error_sd_percent_most : float
        Standard deviation of the error that takes all points of its part, in percent of span. [%]
    """

    name: str
    source: str
    kind: LoopKind
    weights: tuple[tuple[str, float], ...]
    service_factor_least: float
    saturated_most: float
    clipped_most: float
    good_least: float
    eta_least: float
    error_sd_percent_most: float

    def __post_init__(self) -> None:
        if {name for name, _ in self.weights} != set(PARTS):
            raise ValueError(f"a score profile weighs {', '.join(PARTS)}")
        if abs(sum(weight for _, weight in self.weights) - 1) > 1e-9:
            raise ValueError(f"the weights of {self.name} for {self.kind} must sum to 1")


def score_profile_names() -> tuple[str, ...]:
    """Names of the profiles that are installed."""
    return tuple(sorted(file.stem for file in FOLDER.glob("*.json")))


def score_profile(
    kind: LoopKind = LoopKind.OTHER, name: str = DEFAULT_SCORE_PROFILE
) -> ScoreProfile:
    """Read the weights and limits of a kind of loop.

    Raises
    ------
    ValueError
        There is no such profile.
    """
    if name not in score_profile_names():
        raise ValueError(f"there is no score profile {name!r}: {', '.join(score_profile_names())}")
    body = json.loads((FOLDER / f"{name}.json").read_text("utf-8"))
    return profile_of(body, kind)


def profile_of(body: Mapping[str, object], kind: LoopKind) -> ScoreProfile:
    """Take the numbers of one kind of loop from a profile's document."""
    kinds, limits = body["kinds"], body["limits"]
    if not isinstance(kinds, Mapping) or not isinstance(limits, Mapping):
        raise ValueError("a score profile holds limits and kinds")  # noqa: TRY004 -- a file's fault
    row = kinds[kind.value]
    return ScoreProfile(
        name=str(body["name"]),
        source=str(body["source"]),
        kind=kind,
        weights=tuple((part, float(row[part])) for part in PARTS),
        error_sd_percent_most=float(row["error_sd_percent_most"]),
        **{name: float(value) for name, value in limits.items()},
    )
