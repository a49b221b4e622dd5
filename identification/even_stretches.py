"""Evenly spaced samples of a loop without gaps, and averages of neighbours of them."""

from collections.abc import Sequence
from dataclasses import dataclass

from loop.signals import Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """Evenly spaced samples without a gap.

    Attributes
    ----------
    pv : ndarray, shape (n,)
        Process variable. [PV]
    op : ndarray, shape (lead + n,)
        Output, held until the next sample; its first `lead` samples lie before the first of PV.
        [OP]
    lead : int
        Samples of OP before the first of PV.
    """

    pv: Real
    op: Real
    lead: int = 0

    def __post_init__(self) -> None:
        if self.lead < 0 or self.op.size != self.lead + self.pv.size:
            raise ValueError(
                f"{self.pv.size} samples of PV with a lead of {self.lead} need "
                f"{self.lead + self.pv.size} of OP, got {self.op.size}"
            )


def thinned(stretches: Sequence[Stretch], by: int) -> tuple[Stretch, ...]:
    """Average each `by` neighbours of PV and of OP.

    Both averages run from the same sample on, so that the noise in one average of PV meets no
    earlier average of an output that answered it. The average of PV then lies (by - 1)/2 samples
    behind the instant from which its OP counts as held, and the dead time of a fit is too short
    by that much.

    Parameters
    ----------
    stretches : sequence of Stretch
        Samples.
    by : int
        Neighbours to average, 1 for none.

    Returns
    -------
    tuple of Stretch
        Those that keep at least one average.
    """
    if by == 1:
        return tuple(stretches)
    thin = []
    for s in stretches:
        lead, n = s.lead // by, s.pv.size // by
        if n:
            first = s.lead - lead * by
            op = s.op[first : first + (lead + n) * by]
            thin.append(
                Stretch(
                    pv=s.pv[: n * by].reshape(n, by).mean(axis=1),
                    op=op.reshape(lead + n, by).mean(axis=1),
                    lead=lead,
                )
            )
    return tuple(thin)
