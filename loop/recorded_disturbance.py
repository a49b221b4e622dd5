"""What disturbed a loop during a record: PV less the answer of the process to the output."""

from dataclasses import dataclass

import numpy as np

from loop.open_loop import process_output
from loop.process import Process
from loop.record import Record
from loop.sampled_process import scans_in
from loop.signals import Flags, Real

# Longer pauses between good samples than so many usual ones are gaps; a replay over more than
# this part of the record would be invented.
USUAL = 3.5
MOST_BRIDGED = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedDisturbance:
    """A record as set point and disturbance, scan by scan.

    Attributes
    ----------
    sp, pv, op : ndarray, shape (n,)
        Set point, process variable and output of the record at the scans. [PV], [PV], [OP]
    disturbance : ndarray, shape (n,)
        PV less the answer of the process to the output, 0 at the first scan. [PV]
    dt : float
        Scan time. [s]
    bridged : float
        Part of the record within gaps, which straight lines close. [-]
    """

    sp: Real
    pv: Real
    op: Real
    disturbance: Real
    dt: float
    bridged: float


def recorded_disturbance(record: Record, process: Process, *, dt: float) -> RecordedDisturbance:
    """Take the disturbance of a record out of it, d = pv - pv[0] - P (op - op[0]).

    Fed back as output disturbance of the same process, with the same outputs, it gives the record
    again. It holds noise, loads and every error of the model, and whatever had not settled when
    the record began.

    Parameters
    ----------
    record : Record
        Routine data with a set point; PV follows straight lines between its good samples, set
        point and output hold.
    process : Process
        Process model.
    dt : float
        Scan time of the replay. [s]

    Raises
    ------
    ValueError
        The record has no set point, too few good samples or too large gaps.
    """
    if record.sp is None:
        raise ValueError("the record has no set point, so there is nothing to replay against")
    good = np.isfinite(record.pv) & np.isfinite(record.op) & np.isfinite(record.sp)
    if np.count_nonzero(good) < 10:
        raise ValueError(
            f"{np.count_nonzero(good)} samples have set point, PV and OP; a replay needs 10"
        )
    t = record.t[good] - record.t[good][0]
    bridged = _bridged(t)
    if bridged > MOST_BRIDGED:
        raise ValueError(
            f"{100 * bridged:.0f} % of the record are gaps, more than {100 * MOST_BRIDGED:.0f} %; "
            "replay a stretch without them"
        )
    if not 0 < dt <= t[-1] / 2:
        raise ValueError(f"dt must be positive and at most half the record, got {dt}")
    grid = np.arange(scans_in(float(t[-1]), dt)) * dt
    held = np.searchsorted(t, grid * (1 + 1e-12), side="right") - 1
    pv = np.interp(grid, t, record.pv[good])
    op = record.op[good][held]
    answer = process_output(process, grid, op)
    return RecordedDisturbance(
        sp=record.sp[good][held],
        pv=pv,
        op=op,
        disturbance=pv - pv[0] - answer,
        dt=dt,
        bridged=bridged,
    )


def _bridged(t: Real) -> float:
    """Part of the time between good samples that are unusually far apart."""
    pauses = np.diff(t)
    long: Flags = pauses > USUAL * np.median(pauses)
    return float(pauses[long].sum() / t[-1])
