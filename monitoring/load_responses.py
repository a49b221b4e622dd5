"""Load disturbances: did the controller answer sluggishly or swing?"""

from dataclasses import dataclass

import numpy as np

from loop.signals import Flags, Real
from monitoring.basis import Basis, graded, refusal
from monitoring.loop_signals import Stretch
from monitoring.sensor import noise_level

# A response stands out where the error exceeds this many times the noise and its own usual spread.
CLEAR = 4.0
FEWEST_SAMPLES = 12
FEWEST_RESPONSES = 3
MOST_RESPONSES = 30
SLUGGISH = 0.4
SWINGING = 0.35


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadResponses:
    """Indices over the clear load responses of a stretch.

    Attributes
    ----------
    responses : int
        Responses that were used.
    idle_index : float or None
        Ii = (t_pos - t_neg)/(t_pos + t_neg), t_pos the time in which moves of OP and PV have the
        sign of the process gain [1]_: near 1 for a sluggish loop. [-]
    area_index : float or None
        Ia = max(A1..A_{n-2})/(A1 + ... + A_{n-1}) of OP about its final value [2]_, median over
        the responses with three areas: near 1 where one area outweighs all others, small where OP
        swings to and fro. [-]
    sluggish, swinging : bool
        Ii beyond 0.4; Ia below 0.35.
    basis : Basis
        What this rests on.

    References
    ----------
    .. [1] T. Hägglund, "Automatic detection of sluggish control loops", Control Engineering
       Practice 7 (1999); from memory.
    .. [2] A. Visioli, "Method for proportional-integral controller tuning assessment", Industrial
       & Engineering Chemistry Research 45 (2006); from memory.
    """

    responses: int
    idle_index: float | None
    area_index: float | None
    sluggish: bool
    swinging: bool
    basis: Basis


def load_responses(stretch: Stretch, *, gain_sign: int | None = None) -> LoadResponses:
    """Measure the clear load responses between set-point moves.

    Parameters
    ----------
    stretch : Stretch
        Controlled part of a record.
    gain_sign : {1, -1}, optional
        Sign of the process gain; if not given, that of the controller seen in the data: OP moves
        with the error in a reverse-acting loop.
    """
    settings = (
        ("clear, times the noise", CLEAR),
        ("fewest responses", float(FEWEST_RESPONSES)),
        ("sluggish beyond", SLUGGISH),
        ("swinging below", SWINGING),
    )
    events = _events(stretch)
    if len(events) < FEWEST_RESPONSES:
        why = f"{len(events)} load responses stand out of the noise, fewer than {FEWEST_RESPONSES}"
        return LoadResponses(
            responses=len(events), idle_index=None, area_index=None, sluggish=False,
            swinging=False, basis=refusal(why, share=stretch.share, settings=settings),
        )  # fmt: skip
    doubts: tuple[str, ...] = ()
    sign = gain_sign
    if sign is None:
        sign = _action_seen(stretch)
        doubts = ("the sign of the process gain is that of the controller seen in the data",)
    times = np.array([_idle_times(stretch.pv[part], stretch.op[part], sign) for part in events])
    positive, negative = times.sum(axis=0)
    areas = [index for part in events if (index := _area_index(stretch.op[part])) is not None]
    total = positive + negative
    idle = float((positive - negative) / total) if total > 0 else None
    area = float(np.median(areas)) if len(areas) >= FEWEST_RESPONSES else None
    return LoadResponses(
        responses=len(events),
        idle_index=idle,
        area_index=area,
        sluggish=idle is not None and idle > SLUGGISH,
        swinging=area is not None and area < SWINGING,
        basis=graded(stretch.share, doubts, settings=settings),
    )


def _events(stretch: Stretch) -> list[slice]:
    """Excursions of the error that start without a set-point move, up to the next one."""
    error = stretch.error
    smooth = smoothed(error, 3)
    threshold = CLEAR * max(noise_level(error), 0.35 * float(np.std(error)))
    outside = np.abs(smooth) > threshold
    starts = np.flatnonzero(outside[1:] & ~outside[:-1]) + 1
    turns = np.r_[0, np.flatnonzero((smooth[1:] > 0) != (smooth[:-1] > 0)) + 1]
    begins = turns[np.searchsorted(turns, starts, side="right") - 1]
    if stretch.sp is not None:
        moves = np.flatnonzero(np.diff(stretch.sp) != 0) + 1
        near = np.searchsorted(moves, starts, side="right")
        moved = (near > 0) & (moves[np.maximum(near - 1, 0)] >= begins) if moves.size else near < 0
        starts, begins = starts[~moved], begins[~moved]
        limits = np.r_[moves, error.size]
    else:
        limits = np.array([error.size])
    begins = np.unique(begins)
    ends = np.minimum(
        np.r_[begins[1:], error.size][: begins.size], limits[np.searchsorted(limits, begins + 1)]
    )
    long = np.flatnonzero(ends - begins >= FEWEST_SAMPLES)[:MOST_RESPONSES]
    return [slice(int(begins[k]), int(ends[k])) for k in long]


def smoothed(signal: Real, width: int) -> Real:
    """Centred moving mean; the ends keep their own value."""
    width = max(min(width, signal.size // 3), 1) | 1
    half = width // 2
    padded = np.empty(signal.size + 2 * half + 1)
    padded[0] = 0.0
    padded[1 : half + 1] = signal[0]
    padded[half + 1 : half + 1 + signal.size] = signal
    padded[half + 1 + signal.size :] = signal[-1]
    sums = np.cumsum(padded)
    return np.asarray((sums[width:] - sums[:-width]) / width)


def _idle_times(pv: Real, op: Real, sign: int) -> tuple[float, float]:
    """Samples in which OP and PV move with, and against, the sign of the gain; rest left out."""
    width = max(pv.size // 10, 3)
    dpv, dop = smoothed_steps(pv, width), smoothed_steps(op, width)
    moving = _moving(dpv) & _moving(dop)
    product = sign * dpv * dop
    return (
        float(np.count_nonzero((product > 0) & moving)),
        float(np.count_nonzero((product < 0) & moving)),
    )


def smoothed_steps(signal: Real, width: int) -> Real:
    """Steps of the centred moving mean: what enters it less what leaves it, without any sum."""
    width = max(min(width, signal.size // 3), 1) | 1
    half = width // 2
    ends = np.full(half, signal[0]), np.full(half, signal[-1])
    padded = np.concatenate((ends[0], signal, ends[1]))
    return np.asarray((padded[width:] - padded[:-width]) / width)


def _moving(steps: Real) -> Flags:
    size = np.abs(steps)
    return np.asarray(size >= 0.02 * size.max(initial=0.0))


def _area_index(op: Real) -> float | None:
    """Largest inner area over all but the last, of OP about its final value."""
    final = float(op[-max(op.size // 10, 2) :].mean())
    away = smoothed(op, max(op.size // 20, 3)) - final
    above = away > 0
    turns = np.flatnonzero(above[1:] != above[:-1]) + 1
    if turns.size < 2:
        return None
    areas = np.abs(np.add.reduceat(away, np.concatenate(([0], turns))))
    whole = float(areas[:-1].sum())
    return float(areas[:-2].max()) / whole if whole > 0 else None


def _action_seen(stretch: Stretch) -> int:
    """1 where OP moves with the error, -1 where it moves against it."""
    together = float(np.diff(stretch.op) @ np.diff(stretch.error))
    return 1 if together >= 0 else -1
