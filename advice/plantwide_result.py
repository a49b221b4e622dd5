"""What loops of a plant have in common: groups, suspects, arrows, delays and cascades."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspect:
    """One loop of a group that oscillates together.

    Attributes
    ----------
    tag : str
        The loop.
    probability : float
        That the oscillation begins, or enters, here. [-]
    nonlinearity : float or None
        Index of its signal; the loop where an oscillation begins often has the largest. [-]
    stiction : float or None
        Probability that its valve sticks; None where that cannot be judged. [-]
    coherence : float
        How well it keeps step with the loop that shows the oscillation best. [-]
    share : float
        Part of its variance at the period of the group. [-]
    oscillates : bool
        It has an oscillation of its own that was found; otherwise it only feels the group's.
    evidence : tuple of str
        What is known of it, one fact a sentence.
    reason : str
        The same as one text.
    """

    tag: str
    probability: float
    nonlinearity: float | None
    stiction: float | None
    coherence: float
    share: float
    oscillates: bool
    evidence: tuple[str, ...]
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrow:
    """What the past of one loop adds to the prediction of another (Granger).

    Attributes
    ----------
    cause, effect : str
        Tags.
    strength : float
        ln(residual sum of squares without the cause / with it). [-]
    p_value : float
        Of the F test. [-]
    beyond : float or None
        Standard deviations by which it exceeds causes shifted in time; None where the F test sees
        nothing. [-]
    significant : bool
        Both tests agree.
    """

    cause: str
    effect: str
    strength: float
    p_value: float
    beyond: float | None
    significant: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferredInformation:
    """Transfer entropy from one loop to another.

    Attributes
    ----------
    cause, effect : str
        Tags.
    value : float or None
        What the past of the cause tells beyond that of the effect; None where the record is too
        short. [nat]
    by_chance : float or None
        Mean over causes shifted in time. [nat]
    p_value : float or None
        Share of shifted causes that tell as much, the true one among them. [-]
    beyond : float or None
        Standard deviations above the shifted causes. [-]
    significant : bool
        Above every shifted cause, and three standard deviations above their mean.
    delay : float or None
        Delay at which the cause tells most. [s]
    """

    cause: str
    effect: str
    value: float | None
    by_chance: float | None
    p_value: float | None
    beyond: float | None
    significant: bool
    delay: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Delay:
    """By how much one loop follows another.

    Attributes
    ----------
    first, second : str
        Tags.
    delay : float
        The second follows the first by so much; negative where it leads. [s]
    error : float
        Standard error. [s]
    sign : {1, -1}
        Whether it follows the first or its mirror image.
    correlation : float
        At that delay, without sign. [-]
    rival : float
        The next best delay. [s]
    clear : bool
        The delay stands out from every rival; otherwise it is known up to them only.
    phase_delay : float or None
        From the phases at the harmonics, up to whole periods. [s]
    """

    first: str
    second: str
    delay: float
    error: float
    sign: int
    correlation: float
    rival: float
    clear: bool
    phase_delay: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Graph:
    """Arrows and delays as two matrices, for a picture.

    Attributes
    ----------
    tags : tuple of str
        Names of rows and columns, the likeliest source first.
    strength : tuple of tuple of (float or None)
        From the loop of the row to that of the column; None where there is no arrow. [-]
    delay : tuple of tuple of (float or None)
        The loop of the column follows that of the row by so much; None where it is not known. [s]
    """

    tags: tuple[str, ...]
    strength: tuple[tuple[float | None, ...], ...]
    delay: tuple[tuple[float | None, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class OscillationGroup:
    """Loops that share an oscillation, and where it likely begins.

    Attributes
    ----------
    period : float
        Their period. [s]
    similarity : float
        Least coherence of two loops with an oscillation of their own; of their spectra where the
        record is short. [-]
    source : str or None
        Tag of the loop where it likely begins or enters; None where the data do not say.
    elsewhere : float
        Probability that it reaches several of them at once from outside. [-]
    reason : str
        What that rests on.
    suspects : tuple of Suspect
        All of them, the likeliest source first.
    arrows : tuple of Arrow
        Every ordered pair that was tested.
    order : int or None
        Lags of the regressions behind them.
    delays : tuple of Delay
        Every pair that was measured.
    graph : Graph
        Both as matrices.
    transfers : tuple of TransferredInformation
        Between the likeliest source and its two nearest rivals, both ways; empty in groups in
        which more than four loops are compared. The probabilities do not rest on it.
    doubts : tuple of str
        What could not be judged, and why.
    """

    period: float
    similarity: float
    source: str | None
    elsewhere: float
    reason: str
    suspects: tuple[Suspect, ...]
    arrows: tuple[Arrow, ...]
    order: int | None
    delays: tuple[Delay, ...]
    graph: Graph
    transfers: tuple[TransferredInformation, ...]
    doubts: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cascade:
    """An outer loop whose output is an inner loop's set point.

    Attributes
    ----------
    outer, inner : str
        Tags.
    explained : float
        Part of the inner set point's moves that the outer output explains. [-]
    """

    outer: str
    inner: str
    explained: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantOscillations:
    """What loops have in common over one period.

    Attributes
    ----------
    groups : tuple of OscillationGroup
        The largest first.
    cascades : tuple of Cascade
        Pairs that were recognised.
    left_out : tuple of (str, str)
        Loops that could not be looked at, and why.
    """

    groups: tuple[OscillationGroup, ...]
    cascades: tuple[Cascade, ...]
    left_out: tuple[tuple[str, str], ...]
