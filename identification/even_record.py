"""A record on an even grid of time, with what the controller's mode says of every sample."""

from dataclasses import dataclass

import numpy as np

from identification.even_stretches import Stretch
from loop.errors import PoorExcitation
from loop.record import Mode, Record
from loop.signals import Flags, Real

# Fewer carry no model with a noise model.
FEWEST_ROWS = 60
# Samples off the even grid by more than a third of their spacing make a dead time uncertain.
OFF_GRID, MOST_OFF_GRID = 0.34, 0.02
# A grid of more rows than this for each sample is a record of holes.
MOST_ROWS_A_SAMPLE = 20
# Far beyond any range of a transmitter.
LARGEST = 1e12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EvenRecord:
    """Samples at t0 + k dt, NaN where there is none.

    Attributes
    ----------
    t0, dt : float
        First instant and spacing. [s]
    pv, op, sp : ndarray, shape (n,)
        Signals; sp is NaN throughout where the record has none. [PV], [OP], [PV]
    automatic : ndarray of bool, shape (n,)
        Whether a controller decided the output.
    known : ndarray of bool, shape (n,)
        Whether PV and OP are both there.
    """

    t0: float
    dt: float
    pv: Real
    op: Real
    sp: Real
    automatic: Flags
    known: Flags

    @property
    def rows(self) -> int:
        """Rows of the grid."""
        return self.pv.size

    def time(self, row: int) -> float:
        """Instant of a row. [s]"""
        return self.t0 + row * self.dt

    def stretch(self, first: int, last: int, lead: int) -> Stretch:
        """Rows first to last - 1 as a stretch with up to `lead` rows of OP before it.

        Parameters
        ----------
        first, last : int
            Rows, all known.
        lead : int
            Rows before, of which those up to the last gap are taken.
        """
        before = self.known[max(first - lead, 0) : first]
        gaps = np.flatnonzero(~before)
        kept = before.size - (int(gaps[-1]) + 1 if gaps.size else 0)
        return Stretch(pv=self.pv[first:last], op=self.op[first - kept : last], lead=kept)


def even_record(record: Record) -> EvenRecord:
    """Lay a record on the grid of its median spacing.

    A mode that is not known counts as automatic where the record has a set point, since a
    controller that is not in automatic has no use for one.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time.

    Raises
    ------
    PoorExcitation
        Too few samples, samples off any even grid, or values that no instrument gives.
    """
    known = np.isfinite(record.pv) & np.isfinite(record.op)
    count = int(np.count_nonzero(known))
    if count < FEWEST_ROWS:
        raise PoorExcitation(
            f"Only {count} samples have both PV and OP; a model of a loop in automatic needs at "
            f"least {FEWEST_ROWS}."
        )
    largest = max(float(np.max(np.abs(record.pv[known]))), float(np.max(np.abs(record.op[known]))))
    if largest > LARGEST:
        raise PoorExcitation(
            f"PV or OP reaches {largest:.3g}, which no measurement does; mark such readings as bad."
        )
    t = record.t[known]
    dt = float(np.median(np.diff(t)))
    place = (t - t[0]) / dt
    row = np.rint(place).astype(np.intp)
    off = float(np.mean(np.abs(place - row) > OFF_GRID))
    rows = int(row[-1]) + 1
    if off > MOST_OFF_GRID or rows > MOST_ROWS_A_SAMPLE * count:
        raise PoorExcitation(
            f"{off:.0%} of the samples lie off an even grid of {dt:.3g} s, and {count} samples "
            f"spread over {rows} such intervals; export the record at an even sample time."
        )
    sp = np.full(t.size, np.nan) if record.sp is None else record.sp[known]
    automatic = np.full(t.size, record.sp is not None)
    if record.mode is not None:
        mode = record.mode[known]
        automatic = np.where(mode == Mode.UNKNOWN, automatic, mode != Mode.MAN)
    return EvenRecord(
        t0=float(t[0]),
        dt=dt,
        pv=_placed(record.pv[known], row, rows),
        op=_placed(record.op[known], row, rows),
        sp=_placed(sp, row, rows),
        automatic=_placed(automatic.astype(np.float64), row, rows) == 1.0,
        known=np.isfinite(_placed(record.pv[known], row, rows)),
    )


def _placed(values: Real, row: "np.ndarray[tuple[int], np.dtype[np.intp]]", rows: int) -> Real:
    placed = np.full(rows, np.nan)
    placed[row] = values
    return placed
