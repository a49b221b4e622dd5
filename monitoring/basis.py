"""What an index rests on: how much of the data, by which settings, and how far to trust it."""

from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

Setting: TypeAlias = tuple[str, float | str]


class Confidence(StrEnum):
    """How far a number may be trusted; NONE means that there is no number."""

    HIGH = "high"
    MEDIUM = "medium"
    LOW = "low"
    NONE = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Basis:
    """What stands behind an index.

    Attributes
    ----------
    share : float
        Part of the record's samples that was used, 0 to 1. [-]
    confidence : Confidence
        How far the index may be trusted.
    reasons : tuple of str
        Why not more, or why not at all.
    settings : tuple of (str, float or str)
        Every number that was chosen, under its name.
    """

    share: float
    confidence: Confidence
    reasons: tuple[str, ...] = ()
    settings: tuple[Setting, ...] = ()

    @property
    def refused(self) -> bool:
        """Whether there is no number at all."""
        return self.confidence is Confidence.NONE


def refusal(reason: str, *, share: float = 0.0, settings: tuple[Setting, ...] = ()) -> Basis:
    """Say why an index has no number."""
    return Basis(share=share, confidence=Confidence.NONE, reasons=(reason,), settings=settings)


def graded(
    share: float, doubts: tuple[str, ...] = (), *, settings: tuple[Setting, ...] = ()
) -> Basis:
    """Grade an index by how much data it saw and how many doubts there are.

    No doubt and at least half of the record make high confidence; each doubt, and less than half
    of the record, take one grade; LOW is the floor.
    """
    if share < 0.5:
        doubts = (*doubts, f"only {share:.0%} of the record could be used")
    grades = (Confidence.HIGH, Confidence.MEDIUM, Confidence.LOW)
    return Basis(
        share=share,
        confidence=grades[min(len(doubts), 2)],
        reasons=doubts,
        settings=settings,
    )
