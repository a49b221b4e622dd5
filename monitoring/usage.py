"""How much the loop was used: service, saturation, work of the output, hands on it."""

from dataclasses import dataclass

import numpy as np

from loop.record import Mode
from loop.signals import Flags, Real
from monitoring.basis import Basis, graded, refusal
from monitoring.loop_signals import SATURATION_MARGIN, LoopSignals

DAY = 86_400.0
# Moves of the output below this part of its range are noise of the signal path.
OP_DEADBAND = 0.0005
# A controller within this part of the PV span of its set point does its work.
ERROR_BAND = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """Use of a loop; None where the data do not say.

    Attributes
    ----------
    service_factor : float or None
        Time in AUTO, CAS or REMOTE over time with a known mode. [-]
    modes : tuple of (str, float)
        Part of the record in every mode. [-]
    effective_service_factor : float or None
        Time in automatic, not saturated and with the error in its band, over time with a known
        mode, PV, OP and set point. [-]
    saturated_low, saturated_high : float or None
        Part of the known outputs at either limit. [-]
    travel : float or None
        sum |dOP| a day. [OP/d]
    reversals : float or None
        Changes of direction of OP an hour; one counts once OP has moved back by the dead band, in
        however many samples. [1/h]
    mode_changes, manual_moves : float or None
        Changes of mode, and moves of the output in manual, a day. [1/d]
    basis : Basis
        What the numbers rest on.
    """

    service_factor: float | None
    modes: tuple[tuple[str, float], ...]
    effective_service_factor: float | None
    saturated_low: float | None
    saturated_high: float | None
    travel: float | None
    reversals: float | None
    mode_changes: float | None
    manual_moves: float | None
    basis: Basis

    @property
    def saturated(self) -> float | None:
        """Part of the known outputs at a limit. [-]"""
        if self.saturated_low is None or self.saturated_high is None:
            return None
        return self.saturated_low + self.saturated_high


def usage(signals: LoopSignals, *, error_band: float = ERROR_BAND) -> Usage:
    """Measure how much a loop was used.

    Parameters
    ----------
    signals : LoopSignals
        The loop on an even grid.
    error_band : float
        Half-width of the band of the error, as part of the PV span. [-]
    """
    n = signals.pv.size
    known_op = np.isfinite(signals.op)
    count = int(np.count_nonzero(known_op))
    settings = (
        ("saturation margin, part of the OP range", SATURATION_MARGIN),
        ("error band, part of the PV span", error_band),
        ("dead band of a move, part of the OP range", OP_DEADBAND),
    )
    if count < 2:
        basis = refusal("fewer than two outputs are known", settings=settings)
        return Usage(
            service_factor=_service(signals), modes=_modes(signals),
            effective_service_factor=None, saturated_low=None, saturated_high=None,
            travel=None, reversals=None, mode_changes=_mode_changes(signals), manual_moves=None,
            basis=basis,
        )  # fmt: skip
    moves = np.diff(signals.op)
    seen = np.isfinite(moves)
    hours = max(int(np.count_nonzero(seen)), 1) * signals.dt / 3600
    doubts = () if signals.mode_known else ("the mode was not recorded",)
    return Usage(
        service_factor=_service(signals),
        modes=_modes(signals),
        effective_service_factor=_effective(signals, error_band),
        saturated_low=float(np.count_nonzero(signals.low & known_op) / count),
        saturated_high=float(np.count_nonzero(signals.high & known_op) / count),
        travel=float(np.sum(np.abs(moves[seen])) / hours * 24),
        reversals=reversals_of(signals.op[known_op], OP_DEADBAND * signals.op_span) / hours,
        mode_changes=_mode_changes(signals),
        manual_moves=_manual_moves(signals, moves),
        basis=graded(count / n, doubts, settings=settings),
    )


def reversals_of(op: Real, dead_band: float) -> int:
    """Count the changes of direction that remain when swings below a dead band are smoothed away.

    A single sample of a slow move is always small; what counts is how far OP comes back.

    Parameters
    ----------
    op : ndarray, shape (n,)
        Output without gaps, one sample at least. [OP]
    dead_band : float
        Smallest move back that counts. [OP]
    """
    moved = op[np.r_[True, np.diff(op) != 0]]
    up = np.diff(moved) > 0
    ends = moved[np.r_[True, up[1:] != up[:-1], True]] if moved.size > 2 else moved
    while ends.size > 1:
        swings = np.abs(np.diff(ends))
        before, after = np.r_[np.inf, swings[:-1]], np.r_[swings[1:], np.inf]
        # The smallest swing of its neighbours goes with both its ends: what is left still turns
        # at every point. At the ends of the record only the outer point goes. Of equal swings in
        # a row every second one goes.
        small = np.flatnonzero((swings < dead_band) & (swings <= before) & (swings <= after))
        if not small.size:
            break
        places = np.arange(small.size)
        firsts = np.where(np.r_[True, np.diff(small) > 1], places, 0)
        small = small[(places - np.maximum.accumulate(firsts)) % 2 == 0]
        inner = small[(small > 0) & (small < swings.size - 1)]
        outer = [0] * int(small[0] == 0) + [swings.size] * int(small[-1] == swings.size - 1)
        ends = np.delete(ends, np.r_[inner, inner + 1, outer].astype(np.int64))
    return max(int(ends.size) - 2, 0)


def _known_mode(signals: LoopSignals) -> Flags:
    if signals.mode is None:
        return np.zeros(signals.pv.size, dtype=np.bool_)
    return np.asarray(signals.mode != Mode.UNKNOWN)


def _service(signals: LoopSignals) -> float | None:
    known = _known_mode(signals)
    count = int(np.count_nonzero(known))
    return float(np.count_nonzero(signals.automatic & known) / count) if count else None


def _modes(signals: LoopSignals) -> tuple[tuple[str, float], ...]:
    if signals.mode is None:
        return ((Mode.UNKNOWN.name, 1.0),)
    counts = np.bincount(signals.mode.astype(np.int64) + 1, minlength=len(Mode))
    return tuple(
        (mode.name, float(counts[mode + 1] / signals.mode.size))
        for mode in Mode
        if counts[mode + 1]
    )


def _effective(signals: LoopSignals, error_band: float) -> float | None:
    error, span = signals.error, signals.pv_span
    if error is None or span is None or not signals.mode_known:
        return None
    judged = _known_mode(signals) & signals.known & np.isfinite(error)
    count = int(np.count_nonzero(judged))
    if not count:
        return None
    good = judged & signals.automatic & ~signals.low & ~signals.high
    good &= np.abs(np.where(judged, error, 0.0)) <= error_band * span
    return float(np.count_nonzero(good) / count)


def _mode_changes(signals: LoopSignals) -> float | None:
    known = _known_mode(signals)
    if signals.mode is None or not known.any():
        return None
    modes = signals.mode[known]
    return float(np.count_nonzero(np.diff(modes)) / (modes.size * signals.dt / DAY))


def _manual_moves(signals: LoopSignals, moves: np.ndarray) -> float | None:
    """Moves of the output in manual; one that takes several samples in a row counts once."""
    if signals.mode is None or not signals.mode_known:
        return None
    by_hand = (signals.mode[1:] == Mode.MAN) & (signals.mode[:-1] == Mode.MAN)
    size = np.where(np.isfinite(moves), np.abs(moves), 0.0)
    moved = by_hand & (size > OP_DEADBAND * signals.op_span)
    starts = np.count_nonzero(moved[1:] & ~moved[:-1]) + int(moved[:1].any())
    return float(starts / (signals.pv.size * signals.dt / DAY))
