"""Recognise a frequency test (chirp, sine steps, multisine) and hold a model to what it shows."""

import numpy as np
from scipy.fft import rfft, rfftfreq

from identification.frequency_response import FrequencyResponse
from identification.verdict import Finding, Verdict, graded
from loop.errors import PoorExcitation
from loop.process import Process, rational_response
from loop.record import Mode, Record
from loop.signals import Real

FEWEST, EVEN = 100, 0.01
# A test signal moves in nearly every sample from its start to its end, smoothly and to and fro.
MOVING, SMOOTH, TURNS = 0.6, 0.9, 6
# It does not die out, as a loop does after a disturbance: every quarter has so much of the range.
SUSTAINED = 0.2
# It spreads over frequencies: a cycle of a loop stands on one line and its multiples.
LINES, WIDE, EXCITED = 5, 4.0, 0.1
# A model that misses a measured point by more, beyond three deviations, is not that process.
OFF, FAR_OFF, SURE = 0.2, 0.5, 3.0
# Points below this part of the largest matter to no loop.
SMALL = 0.05


def looks_like_frequency_test(record: Record) -> bool:
    """Whether OP was moved smoothly over many frequencies, in manual as far as is known.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time.
    """
    if len(record) < FEWEST or not np.all(np.isfinite(record.pv) & np.isfinite(record.op)):
        return False
    if record.mode is not None and np.any(np.isin(record.mode, (Mode.AUTO, Mode.CAS, Mode.REMOTE))):
        return False
    gaps = np.diff(record.t)
    if float(np.ptp(gaps)) > 2 * EVEN * float(np.median(gaps)):
        return False
    moves = np.flatnonzero(np.diff(record.op))
    if not moves.size:
        return False
    moving = record.op[moves[0] : moves[-1] + 2]
    return moving.size >= FEWEST and _like_waves(moving) and _over_many_frequencies(moving)


def _like_waves(op: Real) -> bool:
    steps = np.diff(op)
    if np.count_nonzero(steps) < MOVING * steps.size:
        return False
    direction = np.sign(steps[steps != 0])
    turns = int(np.count_nonzero(direction[1:] != direction[:-1]))
    # Square waves turn as often but jump; the median is that of a smooth stretch.
    first, second = np.abs(steps), np.abs(np.diff(steps))
    smooth = float(np.median(second)) < SMOOTH * float(np.median(first))
    ranges = [float(np.ptp(quarter)) for quarter in np.array_split(op, 4)]
    sustained = min(ranges) > SUSTAINED * float(np.ptp(op))
    return turns >= TURNS and smooth and sustained and float(np.max(first)) < float(np.ptp(op))


def _over_many_frequencies(op: Real) -> bool:
    size = np.abs(rfft(op - op.mean()))[1:]
    lines = rfftfreq(op.size)[1:][size > EXCITED * float(np.max(size))]
    return bool(lines.size >= LINES and lines[-1] > WIDE * lines[0])


def judge_measured(response: FrequencyResponse, process: Process) -> Finding:
    """Hold a model, however it was fitted, to the measured points of the response.

    Parameters
    ----------
    response : FrequencyResponse
        Measured points.
    process : Process
        Model.
    """
    s = 1j * response.w
    said = rational_response(process, s) * np.exp(-process.theta * s)
    counts = np.abs(response.G) > SMALL * float(np.max(np.abs(response.G)))
    beyond = np.maximum(np.abs(response.G - said) - SURE * response.sd, 0.0) / np.abs(said)
    # The window of a point bends where the response does; a single point is no verdict.
    part = float(np.quantile(beyond[counts], 0.9))
    where = f"{response.w.size} points from {response.w[0]:.3g} to {response.w[-1]:.3g} rad/s"
    verdict, percent = graded(part, OFF, FAR_OFF), f"{max(100 * part, 1.0):.0f} %"
    text = f"the measured frequency response ({where}) "
    if verdict is Verdict.TRUSTED:
        return Finding(verdict=verdict, reason=text + f"agrees with the model within {percent}")
    return Finding(verdict=verdict, reason=text + f"differs from the model by {percent}")


def judge_unmeasured(fact: PoorExcitation) -> Finding:
    """Say why a frequency test gave no measured response; the fit over time then stands alone."""
    return Finding(verdict=Verdict.CARE, reason=f"the response was not measured: {fact}")
