"""Which way a record goes to a model: as an open-loop test, or as routine data in automatic."""

import numpy as np

from identification.closed_loop import identify_routine, is_routine
from identification.identify import Identification, identify
from identification.relay_model import relay_model
from identification.running_controller import RunningController, running_controller
from loop.errors import NoLimitCycle
from loop.record import Record


def identified(record: Record) -> Identification:
    """Identify the process behind a record, whichever way it was recorded.

    A record whose output moved in manual is an open-loop test. One that was in automatic, or
    whose set point moved while no mode is known, is routine data. An output that switches between
    two levels like a relay's is a relay test in either, if its cycles carry a model. The
    open-loop fit never hands a record that it could fit and refused over to the other one.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time.

    Returns
    -------
    Identification
        A refusal is a result too, with its reasons.
    """
    by_relay = _relay(record)
    if by_relay is not None:
        return by_relay
    if record.mode is None:
        return identify_routine(record) if _set_point_moved(record) else identify(record)
    found = identify(record)
    if found.process is None and found.fitted is None and is_routine(record):
        return identify_routine(record)
    return found


def as_found(record: Record, model: Identification) -> RunningController | None:
    """Read the settings that run from routine data; None for a test, which shows none.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time.
    model : Identification
        What `identified` made of it.
    """
    test = bool(model.steps) or not is_routine(record)
    return None if test or record.sp is None else running_controller(record)


def _relay(record: Record) -> Identification | None:
    """Model of a relay test, None where the record is none or carries none."""
    try:
        found = relay_model(record).model
    except NoLimitCycle:
        return None
    return None if found.process is None else found


def _set_point_moved(record: Record) -> bool:
    """Whether a set point moved that does not merely follow PV, as one does in manual.

    Where the output stands still after the set point's move, nobody listened to it.
    """
    if record.sp is None:
        return False
    known = np.isfinite(record.sp) & np.isfinite(record.pv) & np.isfinite(record.op)
    sp, pv, op = record.sp[known], record.pv[known], record.op[known]
    if sp.size < 2 or np.ptp(sp) == 0:
        return False
    follows = np.count_nonzero(np.diff(sp)) > sp.size / 2 and np.std(sp - pv) < np.std(pv) / 10
    listens = np.count_nonzero(np.diff(op)) > op.size / 5
    return bool(listens and not follows)
