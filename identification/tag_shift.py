"""Whether the time stamps of PV and OP belong together, from what the controller did at once.

In manual a PV that is stamped late looks like dead time, and nothing in the record tells the two
apart. In automatic the controller answers every surprise of PV within a scan, so that OP moves with
it or one sample later. An answer that comes before the surprise is impossible, and one that comes
samples later is a slow scan or a late stamp; a model takes either for a dead time that is wrong.
"""

from dataclasses import dataclass

import numpy as np

from identification.even_record import EvenRecord, even_record
from identification.verdict import Finding, Verdict
from loop.errors import LoopError
from loop.record import Record
from loop.signals import Real

# Past values that predict PV: what they leave is new to the controller as well.
ORDER = 8
# Samples either way in which the answer is sought, and stretches that tell.
REACH, FEWEST = 20, 200
# Standard errors of a correlation, largest of 41, and against the next one that is no neighbour.
CERTAIN, CLEAR = 6.0, 1.5
# The scan that computes OP may fall into the next sample.
AT_ONCE = 1
# A wrong dead time against tau + theta, as a move that was stamped late is judged.
TOO_MUCH = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class TagShift:
    """When OP answers what is new in PV.

    Attributes
    ----------
    cause : str
        "PV" or "SP": what OP answers.
    samples : int
        Samples from the cause to OP; negative where OP comes first.
    seconds : float
        The same. [s]
    strength : float
        Correlation at that shift over its standard error; below 0 where OP moves against the
        cause. [-]
    """

    cause: str
    samples: int
    seconds: float
    strength: float

    @property
    def together(self) -> bool:
        """Whether OP answers within the sample or the next, as a controller does."""
        return 0 <= self.samples <= AT_ONCE


def tag_shifts(record: Record) -> list[TagShift]:
    """Find when the output answers what is new in PV, and when moves of the set point.

    PV less what its last eight values predict is correlated with the changes of OP, over the
    stretches in automatic, for shifts of up to 20 samples either way; so are the moves of the set
    point, which OP answers at once where the proportional part sees them. What tells nothing is
    left out.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time, with its mode or a set point.
    """
    try:
        even = even_record(record)
    except LoopError:
        return []
    stretches = _automatic(even)
    of_pv = _shift("PV", [_surprises(even, a, b) for a, b in stretches], even.dt)
    of_sp = _shift("SP", [_set_points(even, a, b) for a, b in stretches], even.dt)
    if of_pv is not None and of_sp is not None and of_pv.strength * of_sp.strength > 0:
        # A controller moves OP with SP and against PV. Where OP and PV go the same way, PV answers
        # the kick of a set-point move, a dead time later: the process, not a wrong stamp.
        of_pv = None
    return [found for found in (of_pv, of_sp) if found is not None]


def _shift(cause: str, pairs: list[tuple[Real, Real]], dt: float) -> TagShift | None:
    """The one shift at which cause and moves of OP go together, None where none stands out."""
    shifts = np.arange(-REACH, REACH + 1)
    products = np.zeros(shifts.size)
    new_power, move_power, count = 0.0, 0.0, 0
    for new, moves in pairs:
        inside = slice(REACH, new.size - REACH)
        for i, shift in enumerate(shifts.tolist()):
            products[i] += float(new[inside] @ moves[REACH + shift : new.size - REACH + shift])
        new_power += float(new[inside] @ new[inside])
        move_power += float(moves[inside] @ moves[inside])
        count += new.size - 2 * REACH
    if new_power <= 0 or move_power <= 0:
        return None
    size = np.abs(products) / (new_power * move_power) ** 0.5 * count**0.5
    best = int(np.argmax(size))
    apart = np.abs(shifts - shifts[best]) > 1
    if size[best] < CERTAIN or size[best] < CLEAR * float(np.max(size[apart])):
        return None
    return TagShift(
        cause=cause,
        samples=int(shifts[best]),
        seconds=float(shifts[best]) * dt,
        strength=float(np.copysign(size[best], products[best])),
    )


def _automatic(even: EvenRecord) -> list[tuple[int, int]]:
    """Stretches in automatic that are long enough, ends excluded."""
    flags = even.known & even.automatic
    edges = np.flatnonzero(np.diff(flags.astype(int), prepend=0, append=0)).tolist()
    stretches = zip(edges[::2], edges[1::2], strict=True)
    return [(a, b) for a, b in stretches if b - a >= FEWEST]


def _surprises(even: EvenRecord, a: int, b: int) -> tuple[Real, Real]:
    """What is new in PV, and the changes of OP, over one stretch."""
    pv = even.pv[a:b] - even.pv[a:b].mean()
    past = np.stack([pv[ORDER - k : pv.size - k] for k in range(1, ORDER + 1)], axis=1)
    new = pv[ORDER:]
    best = np.linalg.lstsq(past, new, rcond=None)[0]
    moves = np.diff(even.op[a:b])[ORDER - 1 :]
    return new - past @ best, moves - moves.mean()


def _set_points(even: EvenRecord, a: int, b: int) -> tuple[Real, Real]:
    """Moves of the set point and of OP over one stretch; no moves where it is not known."""
    moves, sp = np.diff(even.op[a:b]), np.diff(even.sp[a:b])
    return np.where(np.isfinite(sp), sp, 0.0), moves - moves.mean()


def judge_tag_shift(found: TagShift, slowness: float) -> Finding:
    """Say whether the stamps of PV and OP belong together, and what a shift does to the dead time.

    Parameters
    ----------
    found : TagShift
        When OP answers PV.
    slowness : float
        Lag and dead time of the model together. [s]
    """
    if found.together:
        return Finding(
            verdict=Verdict.TRUSTED,
            reason=f"the controller answers {found.cause} within a sample, so the time stamps of "
            f"{found.cause} and OP belong together",
        )
    size = abs(found.seconds)
    part = size / max(slowness, 1e-300)
    if found.cause == "SP":
        side = "before" if found.samples < 0 else "after"
        text = (
            f"OP answers moves of SP {size:.3g} s {side} them: their time stamps do not belong "
            "together, and those of PV may not either"
        )
    elif found.samples < 0:
        text = (
            f"OP answers PV {size:.3g} s before PV shows it, which no controller can: PV is "
            f"stamped late or OP early, and the dead time of the model is too long by {size:.3g} s"
        )
    else:
        text = (
            f"OP answers PV only after {size:.3g} s: OP is stamped late or PV early, by which the "
            "dead time of the model is too short, or the controller scans so slowly"
        )
    refused = part > TOO_MUCH
    return Finding(
        verdict=Verdict.REFUSED if refused else Verdict.CARE,
        reason=f"{text}, {100 * part:.2g} % of tau + theta",
    )
