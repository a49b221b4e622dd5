"""Set-point moves against what model and settings of the loop sheet lead to expect."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.special import stdtrit

from loop.errors import LoopDiverged
from loop.measures import error_integrals, first_crossing, settling_time
from loop.process import static_gain
from loop.signals import Real
from monitoring.basis import Basis, Setting, graded, refusal
from monitoring.expectation import FEWEST_SAMPLES, Expectation
from monitoring.known_loop import KnownLoop
from monitoring.load_responses import smoothed
from monitoring.loop_signals import Stretch
from monitoring.sensor import noise_level
from monitoring.set_point_moves import MoveResponse, SetPointMoves

MOST_MOVES = 8
# A move must be so many times the error's usual spread, and start that close to its set point.
CLEAR_MOVE = 5.0
AT_REST = 0.3
# Samples away from moves that tell what noise and loads do.
FEWEST_CALM = 30
# A response counts as another one beyond what the uncertain model allows times this.
TOLERANCE = 1.25
OVERSHOOT_TOLERANCE = 10.0
FAR_OFF = 2.0
SETTLED = 0.05
# A load in the course of one move changes it like another process would.
FEWEST_MOVES = 2
# Loads move OP as well: so many moves must agree on a gain.
FEWEST_GAINS = 3


class Departure(StrEnum):
    """How a response differs from the expected one."""

    SLOWER = "slower than expected"
    FASTER = "faster than expected"
    OSCILLATORY = "more oscillatory than expected"
    GAIN_OFF = "the gain of the process is off"
    OTHERWISE = "differs from the expected response"


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedMove:
    """One set-point move against its expectation.

    Attributes
    ----------
    at : float
        Instant of the move from the first sample of the record. [s]
    size : float
        Size of the move. [PV]
    rise_time, expected_rise_time : float or None
        From 10 % to 90 % of the move; None if not reached. [s]
    overshoot, expected_overshoot : float
        Largest excess in percent of the move. [%]
    settling_time, expected_settling_time : float or None
        Time after which PV stays within 5 % of the move or three times the error's usual spread,
        the larger. [s]
    IAE_ratio : float or None
        Integral of |e| over the expected one. [-]
    distance : float
        Root mean square of recorded less expected PV over what noise, disturbances and the
        uncertainty of the model account for. [-]
    gain_ratio : float or None
        Move of PV over that of OP, over the gain of the model; None where it integrates or has
        not settled. Loads move OP as well: one alone says little. [-]
    departures : tuple of Departure
        What differs; empty for a response as expected.
    """

    at: float
    size: float
    rise_time: float | None
    expected_rise_time: float | None
    overshoot: float
    expected_overshoot: float
    settling_time: float | None
    expected_settling_time: float | None
    IAE_ratio: float | None
    distance: float
    gain_ratio: float | None
    departures: tuple[Departure, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedResponse:
    """Set-point moves of a record against the loop sheet.

    Attributes
    ----------
    moves : tuple of ComparedMove
        The clear moves from rest, in order of time.
    as_expected : bool or None
        Whether most of them went as expected; None without any, or where a single one did not.
    departures : tuple of Departure
        What most of the moves show.
    IAE_ratio, gain_ratio, distance : float or None
        Medians over the moves, of the gain only where three moves show it. [-]
    basis : Basis
        What this rests on.
    """

    moves: tuple[ComparedMove, ...]
    as_expected: bool | None
    departures: tuple[Departure, ...]
    IAE_ratio: float | None
    gain_ratio: float | None
    distance: float | None
    basis: Basis


def expected_response(stretch: Stretch, moves: SetPointMoves, known: KnownLoop) -> ExpectedResponse:
    """Simulate each recorded set-point move with model and settings, and compare.

    The expectation is a band: the response of the model and of models whose gain, lags or dead
    time are off by the stated uncertainty.

    Parameters
    ----------
    stretch : Stretch
        Controlled part of a record.
    moves : SetPointMoves
        Its set-point moves.
    known : KnownLoop
        Model, settings and limits.
    """
    settings: tuple[Setting, ...] = (
        ("uncertainty of the model", known.uncertainty),
        ("tolerance beyond it", TOLERANCE),
        ("smallest move over the error's spread", CLEAR_MOVE),
    )
    pid = known.controller
    if pid is None:
        return _nothing("no settings are known", stretch, settings)
    if stretch.sp is None or not moves.responses:
        return _nothing("no set-point move was left alone for long enough", stretch, settings)
    try:
        band = Expectation(stretch.dt, known, pid, stretch.pv.size * stretch.dt)
    except LoopDiverged:
        return _nothing("model and settings make an unstable loop", stretch, settings)
    usual = _usual_spread(stretch, stretch.sp, band.settled, offset=not np.isfinite(pid.Ti))
    if usual is None:
        return _nothing("the set point moves on before responses have settled", stretch, settings)
    largest = sorted(moves.responses, key=lambda move: -abs(move.size))[:MOST_MOVES]
    found = tuple(
        compared
        for move in sorted(largest, key=lambda move: move.at)
        if (compared := _compared(stretch, stretch.sp, move, band, usual)) is not None
    )
    if not found:
        return _nothing(
            "no set-point move is clear of noise and disturbances, from rest and long enough",
            stretch, settings,
        )  # fmt: skip
    return _overall(found, known.uncertainty, stretch, settings)


def _nothing(why: str, stretch: Stretch, settings: tuple[Setting, ...]) -> ExpectedResponse:
    return ExpectedResponse(
        moves=(), as_expected=None, departures=(), IAE_ratio=None, gain_ratio=None, distance=None,
        basis=refusal(why, share=stretch.share, settings=settings),
    )  # fmt: skip


def _overall(
    found: tuple[ComparedMove, ...],
    uncertainty: float,
    stretch: Stretch,
    settings: tuple[Setting, ...],
) -> ExpectedResponse:
    gains = np.array([move.gain_ratio for move in found if move.gain_ratio is not None])
    kinds = [
        kind for kind in Departure
        if 2 * sum(kind in move.departures for move in found) > len(found)
    ]  # fmt: skip
    if _gain_is_off(gains, uncertainty):
        kinds.append(Departure.GAIN_OFF)
    differs = 2 * sum(bool(move.departures) for move in found) > len(found)
    if differs and not kinds:
        kinds.append(Departure.OTHERWISE)
    ratios = [move.IAE_ratio for move in found if move.IAE_ratio is not None]
    doubts: tuple[str, ...] = ()
    alone = len(found) < FEWEST_MOVES
    if alone:
        doubts = ("only one set-point move could be compared",)
        if kinds:
            doubts = ("a single move differs, which a load in its course does as well",)
    return ExpectedResponse(
        moves=found,
        as_expected=None if alone and kinds else not kinds,
        departures=() if alone else tuple(kinds),
        IAE_ratio=float(np.median(ratios)) if ratios else None,
        gain_ratio=float(np.median(gains)) if gains.size >= FEWEST_GAINS else None,
        distance=float(np.median([move.distance for move in found])),
        basis=graded(stretch.share, doubts, settings=settings),
    )


def _gain_is_off(ratios: Real, uncertainty: float) -> bool:
    """The 95 % interval of the mean lies beyond what the model is trusted to."""
    if ratios.size < FEWEST_GAINS or not np.all(ratios > 0):
        return False
    logs = np.log(ratios)
    half = stdtrit(logs.size - 1, 0.975) * float(np.std(logs, ddof=1)) / np.sqrt(logs.size)
    return bool(abs(float(np.mean(logs))) - half > np.log1p(uncertainty))


def _usual_spread(stretch: Stretch, sp: Real, settled: int, *, offset: bool) -> float | None:
    """Root mean square of the error where moves have settled; None where they never have. [PV]

    Without integral action every set point has its own offset, which is no disturbance.
    """
    moved = np.flatnonzero(np.diff(sp)) + 1
    error = stretch.error
    if offset:
        parts = np.cumsum(np.isin(np.arange(sp.size), moved))
        error = error - (np.bincount(parts, error) / np.bincount(parts))[parts]
    near = np.zeros(stretch.pv.size + 1)
    np.add.at(near, moved, 1)
    np.add.at(near, np.minimum(moved + settled, stretch.pv.size), -1)
    calm = error[np.cumsum(near[:-1]) == 0]
    if calm.size < max(FEWEST_CALM, settled // 2):
        return None
    return max(_rms(calm), noise_level(stretch.pv))


def _compared(
    stretch: Stretch, sp: Real, move: MoveResponse, band: Expectation, usual: float
) -> ComparedMove | None:
    """Compare one move; None where it is not clear, not from rest, or too short."""
    k = round(move.at / stretch.dt) - stretch.first
    later = np.flatnonzero(sp[k:] != sp[k])
    length = min(int(later[0]) if later.size else sp.size - k, band.length)
    before = slice(max(k - max(band.length // 4, 3), 0), k)
    start, op0 = float(np.mean(stretch.pv[before])), float(np.mean(stretch.op[before]))
    size = move.size
    away = abs(float(sp[k]) - size - start)
    if length < FEWEST_SAMPLES or abs(size) < CLEAR_MOVE * usual or away > AT_REST * abs(size):
        return None
    expected = band.of(size, op0, length)
    progress = [pv / size for pv, _ in expected]
    # Recorded and expected are smoothed alike, so that noise does not look like a quick rise.
    rise = _rise(band.t[:length], progress[0])
    width = 1 if rise is None else int(0.1 * rise / stretch.dt)
    pv = stretch.pv[k : k + length]
    seen = smoothed((pv - (float(sp[k]) - size)) / size, width)
    progress = [smoothed(one, width) for one in progress]
    # Uncertain gains change OP, not where PV ends: the spread is that of the responses.
    spread = max((_rms(one - progress[0]) for one in progress[1:]), default=0.0)
    noise = usual / abs(size)
    distance = _rms(seen - progress[0]) / np.hypot(spread, max(noise, 1e-9))
    t = band.t[:length]
    shown = [_shown(t, one, max(SETTLED, 3 * noise)) for one in (seen, *progress)]
    ratio = _gain_ratio(stretch, slice(k, k + length), (start, op0), expected[0], band.known)
    IAE = [error_integrals(t, one - 1).IAE for one in (seen, progress[0])]
    return ComparedMove(
        at=move.at,
        size=size,
        rise_time=shown[0].rise,
        expected_rise_time=shown[1].rise,
        overshoot=shown[0].overshoot,
        expected_overshoot=shown[1].overshoot,
        settling_time=shown[0].settling,
        expected_settling_time=shown[1].settling,
        IAE_ratio=IAE[0] / IAE[1] if IAE[1] > 0 else None,
        distance=float(distance),
        gain_ratio=ratio,
        departures=_departures(shown, noise, stretch.dt, float(distance)),
    )


@dataclass(frozen=True, slots=True)
class _Shape:
    rise: float | None
    overshoot: float
    settling: float | None


def _shown(t: Real, progress: Real, tolerance: float) -> _Shape:
    return _Shape(
        rise=_rise(t, progress),
        overshoot=100 * max(float(np.max(progress)) - 1, 0.0),
        settling=settling_time(t, progress - 1, min(tolerance, 0.99)),
    )


def _rise(t: Real, progress: Real) -> float | None:
    start, end = first_crossing(t, progress, 0.1), first_crossing(t, progress, 0.9)
    return None if start is None or end is None else end - start


def _rms(signal: Real) -> float:
    return float(np.sqrt(np.mean(signal**2)))


def _gain_ratio(
    stretch: Stretch,
    part: slice,
    rest: tuple[float, float],
    expected: tuple[Real, Real],
    known: KnownLoop,
) -> float | None:
    """Gain that the ends of PV and OP show, over the model's."""
    gain = static_gain(known.process)
    pv, op = stretch.pv[part], stretch.op[part]
    end = slice(-max(pv.size // 5, 3), None)
    settled = np.all(np.abs(expected[0][end] / expected[0][-1] - 1) < SETTLED)
    moved = float(np.mean(op[end])) - rest[1]
    wanted = float(np.mean(expected[1][end])) - rest[1]
    if not (np.isfinite(gain) and settled and moved * wanted > 0):
        return None
    return (float(np.mean(pv[end])) - rest[0]) / moved / gain


def _departures(
    shown: list[_Shape], noise: float, dt: float, distance: float
) -> tuple[Departure, ...]:
    seen, allowed = shown[0], shown[1:]
    rises = [one.rise for one in allowed if one.rise is not None]
    found = []
    slowest = TOLERANCE * (1 + noise) * max(rises, default=np.inf) + dt
    fastest = min(rises, default=np.inf) - dt
    if len(rises) == len(allowed) and (seen.rise is None or seen.rise > slowest):
        found.append(Departure.SLOWER)
    elif seen.rise is not None and (seen.rise + dt) * TOLERANCE * (1 + 2 * noise) < fastest:
        found.append(Departure.FASTER)
    most = max(one.overshoot for one in allowed)
    if seen.overshoot > most + OVERSHOOT_TOLERANCE + 300 * noise:
        found.append(Departure.OSCILLATORY)
    if not found and distance > FAR_OFF:
        found.append(Departure.OTHERWISE)
    return tuple(found)
