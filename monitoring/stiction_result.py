"""What the stiction indices say together."""

from dataclasses import dataclass
from enum import StrEnum

from monitoring.basis import Basis


class StictionVerdict(StrEnum):
    """Whether the valve sticks."""

    STICTION = "stiction"
    NONE = "no stiction"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True, kw_only=True)
class StictionEvidence:
    """One method's word on the valve.

    Attributes
    ----------
    method : str
        Name of the method.
    value : float or None
        Its index, None where it refused. [-]
    verdict : StictionVerdict
        What the method alone would say by its own published limits.
    note : str
        What the index is, or why there is none.
    """

    method: str
    value: float | None
    verdict: StictionVerdict
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Stiction:
    """Whether the valve sticks, how sure that is, and what it rests on.

    Attributes
    ----------
    verdict : StictionVerdict
        The answer of all methods together.
    probability : float or None
        Calibrated on simulated loops; None where there was nothing to judge. [-]
    evidence : tuple of StictionEvidence
        Every method's word.
    S, J : float or None
        Stiction band and slip jump by the search, in percent of the OP range; for flagged loops
        whose OP and PV a sticking valve explains better than a line. [%]
    apparent_size : float or None
        Apparent stiction: width of the OP-PV figure along OP, in percent of the OP range; it
        shrinks with the loop's own gain and is no property of the valve alone. [%]
    basis : Basis
        What this rests on.
    """

    verdict: StictionVerdict
    probability: float | None
    evidence: tuple[StictionEvidence, ...]
    S: float | None
    J: float | None
    apparent_size: float | None
    basis: Basis
