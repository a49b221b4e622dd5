"""Set-point moves in automatic and how PV followed them."""

from dataclasses import dataclass

import numpy as np

from loop.measures import step_measures
from loop.signals import Real
from monitoring.basis import Basis, graded, refusal
from monitoring.loop_signals import Stretch
from monitoring.sensor import noise_level

# A response is measured only where it lasts this many samples and stands out of the noise.
FEWEST_RESPONSE_SAMPLES = 20
SMALLEST_MOVE = 5.0
MOST_MOVES = 20
# Of n samples the noise's largest lies near sqrt(2 ln n) standard deviations; a loop makes it up to
# this much larger.
LIVELY = 1.4
TINIEST_MOVE = 1e-100
# A set point that changes in more than this part of the samples is the output of something else.
FOLLOWING_SHARE = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveResponse:
    """How PV followed one set-point move.

    Attributes
    ----------
    at : float
        Instant of the move from the first sample of the record. [s]
    size : float
        Size of the move. [PV]
    rise_time : float or None
        From 10 % to 90 % of the move; None if not reached. [s]
    overshoot : float
        Largest excess in percent of the move, 0 where noise alone reaches as far. [%]
    settling_time : float or None
        Time after which PV stays within 5 % of the move, or as near as noise lets it, the larger.
        [s]
    decay_ratio : float or None
        Second over first peak beyond the set point, None without two peaks above the noise. [-]
    """

    at: float
    size: float
    rise_time: float | None
    overshoot: float
    settling_time: float | None
    decay_ratio: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPointMoves:
    """Set-point moves of a stretch.

    Attributes
    ----------
    count : int
        Moves that stand out of the noise.
    following : bool
        The set point changes all the time: a cascade or a ramp, whose responses are not steps.
    responses : tuple of MoveResponse
        The largest moves that were left alone for long enough, in order of time.
    basis : Basis
        What this rests on.
    """

    count: int
    following: bool
    responses: tuple[MoveResponse, ...]
    basis: Basis


def set_point_moves(stretch: Stretch) -> SetPointMoves:
    """Find set-point moves and measure the responses.

    Parameters
    ----------
    stretch : Stretch
        Controlled part of a record.
    """
    settings = (
        ("smallest move over the noise", SMALLEST_MOVE),
        ("fewest samples of a response", float(FEWEST_RESPONSE_SAMPLES)),
        ("following when moved in part of the samples", FOLLOWING_SHARE),
    )
    if stretch.sp is None:
        return SetPointMoves(
            count=0, following=False, responses=(),
            basis=refusal("no set point was recorded", settings=settings),
        )  # fmt: skip
    noise = noise_level(stretch.pv)
    steps = np.diff(stretch.sp)
    moved = np.flatnonzero(steps)
    if moved.size > FOLLOWING_SHARE * stretch.sp.size:
        return SetPointMoves(
            count=int(moved.size), following=True, responses=(),
            basis=graded(stretch.share, settings=settings),
        )  # fmt: skip
    # A move within the rounding of the numbers themselves is none.
    least = max(SMALLEST_MOVE * noise, 1e-9 * float(np.max(np.abs(stretch.pv))), TINIEST_MOVE)
    clear = moved[np.abs(steps[moved]) > least]
    ends = np.r_[moved[1:], stretch.sp.size - 1] if moved.size else moved
    lasting = dict(zip(moved.tolist(), ends.tolist(), strict=True))
    long_enough = [k for k in clear.tolist() if lasting[k] - k >= FEWEST_RESPONSE_SAMPLES]
    largest = sorted(long_enough, key=lambda k: -abs(float(steps[k])))[:MOST_MOVES]
    responses = tuple(_response(stretch, stretch.sp, k, lasting[k], noise) for k in sorted(largest))
    return SetPointMoves(
        count=int(clear.size),
        following=False,
        responses=responses,
        basis=graded(stretch.share, settings=settings),
    )


def _response(stretch: Stretch, sp: Real, k: int, end: int, noise: float) -> MoveResponse:
    """Measure the response to the move between samples k and k + 1, up to sample `end`."""
    part = slice(k, end + 1)
    before, after = float(sp[k]), float(sp[k + 1])
    t = np.arange(end + 1 - k) * stretch.dt
    size = after - before
    reach = LIVELY * np.sqrt(2 * np.log(t.size)) * noise / abs(size)
    band = min(max(0.05, float(reach)), 0.99)
    measures = step_measures(
        t, stretch.pv[part], stretch.op[part], sp=after, pv0=before, at=stretch.dt, band=band
    )
    return MoveResponse(
        at=(stretch.first + k + 1) * stretch.dt,
        size=size,
        rise_time=measures.rise_time,
        overshoot=measures.overshoot if measures.overshoot > 100 * reach else 0.0,
        settling_time=measures.settling_time,
        decay_ratio=_decay(np.sign(size) * (stretch.pv[part] - after), noise),
    )


def _decay(beyond: Real, noise: float) -> float | None:
    """Second over first peak above the set point, each a stretch between two crossings."""
    starts = np.r_[0, np.flatnonzero((beyond[1:] > 0) != (beyond[:-1] > 0)) + 1]
    lengths = np.diff(np.r_[starts, beyond.size])
    peaks = np.maximum.reduceat(beyond, starts)[(lengths > 2) & (beyond[starts] > 0)]
    clear = peaks[peaks > SMALLEST_MOVE * noise]
    return float(clear[1] / clear[0]) if clear.size > 1 else None
