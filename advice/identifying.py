"""Which way a record goes to a model: as an open-loop test, or as routine data in automatic."""

from dataclasses import replace

import numpy as np

from identification.closed_loop import identify_routine, is_routine
from identification.frequency_response import frequency_response
from identification.frequency_test import (
    judge_measured,
    judge_unmeasured,
    looks_like_frequency_test,
)
from identification.identify import Identification, identify
from identification.relay_model import relay_model
from identification.running_controller import RunningController, running_controller
from identification.tag_shift import judge_tag_shift, tag_shifts
from identification.verdict import Finding, Verdict
from loop.errors import NoLimitCycle, PoorExcitation
from loop.process import FOPDT, IPDT, SOPDT
from loop.record import Record

# A loop tuned for the dead time of an integrator looks so many of them ahead.
AHEAD = 5.0


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
    if record.mode is None and not _set_point_moved(record):
        return _test(record)
    found = identify_routine(record) if record.mode is None else _test(record)
    if found.process is None and found.fitted is None and is_routine(record):
        found = identify_routine(record)
    return _with_stamps_that_belong(record, found)


def _test(record: Record) -> Identification:
    """Model of a test in open loop; that of a frequency test is held to the measured response."""
    found = identify(record)
    if found.process is None or found.structure is None or not looks_like_frequency_test(record):
        return found
    process = found.structure.process
    assert process is not None  # noqa: S101 - a model that is used has its process
    try:
        finding = judge_measured(frequency_response(record), process)
    except PoorExcitation as fact:
        finding = judge_unmeasured(fact)
    return _judged(found, finding)


def _with_stamps_that_belong(record: Record, found: Identification) -> Identification:
    """Hold a model of a record with stretches in automatic to when OP answers there."""
    process = found.process
    if isinstance(process, FOPDT):
        slowness = process.tau + process.theta
    elif isinstance(process, SOPDT):
        slowness = process.tau1 + process.tau2 + process.theta
    elif isinstance(process, IPDT) and process.theta:
        slowness = AHEAD * process.theta
    else:
        return found
    for shift in tag_shifts(record):
        found = _judged(found, judge_tag_shift(shift, slowness))
    return found


def _judged(found: Identification, finding: Finding) -> Identification:
    """A model with one finding more, and the verdict that follows."""
    reason = finding.reason[:1].upper() + finding.reason[1:]
    reasons = (*found.reasons, reason if reason.endswith(".") else f"{reason}.")
    if finding.verdict is Verdict.TRUSTED:
        return replace(found, reasons=reasons)
    refused = Verdict.REFUSED in (finding.verdict, found.verdict)
    return replace(
        found,
        process=None if refused else found.process,
        verdict=Verdict.REFUSED if refused else Verdict.CARE,
        reasons=(reasons[-1], *reasons[:-1]),
    )


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
