"""Loops on one grid and the oscillations that they share, with all evidence of where one begins."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from loop.signals import Codes, Real
from monitoring.granger import Granger, granger
from monitoring.loop_signals import LoopSignals, bridged, controlled_stretch
from monitoring.nonlinearity import Nonlinearity, nonlinearity
from monitoring.origin import LoopEvidence, Origin, origin
from monitoring.oscillation import Oscillation, oscillation
from monitoring.propagation import Propagation, propagation
from monitoring.shared_oscillations import SAME_PERIOD, felt, shared_oscillations
from monitoring.stiction import stiction

# Samples a cycle that the regressions see, and cycles: more cost time and tell the same.
A_CYCLE = 20
MOST_CYCLES = 150
# Loops of a group that are compared pair by pair; the others feel it least.
MOST_COMPARED = 8
OCTAVE = 2**0.5
# Correlation from which two loops show one signal.
THE_SAME = 0.98


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """Loops at the same instants.

    Attributes
    ----------
    dt : float
        Sample time. [s]
    error, pv : ndarray, shape (m, n)
        Control errors and process variables, short gaps bridged.
    op : ndarray, shape (m, n)
        Outputs, NaN where unknown.
    mode : tuple of ndarray or None, length m
        Modes of every loop.
    levels : tuple of bool, length m
        Whether a process integrates.
    """

    dt: float
    error: Real
    pv: Real
    op: Real
    mode: tuple[Codes | None, ...]
    levels: tuple[bool, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Swing:
    """One shared oscillation.

    Attributes
    ----------
    members : tuple of int
        Places of the loops on the grid.
    period : float
        Period. [samples]
    similarity : float
        Least similarity of two loops with an oscillation of their own. [-]
    coherence : tuple of float
        How well each keeps step with the one that shows it best. [-]
    own : tuple of bool
        Whether an oscillation of its own was found.
    loops : tuple of LoopEvidence
        What each shows on its own.
    nonlinear : tuple of Nonlinearity
        Their indices, with reasons where there is none.
    compared : tuple of int
        Places in `members` of the loops that arrows and delays are about.
    signals : ndarray, shape (c, n)
        What the regressions see of these: averages of `thinning` samples, of the last cycles.
    arrows : Granger
        Who predicts whom, places as in `compared`; lags in thinned samples.
    delays : tuple of Propagation
        Who follows whom, places as in `compared`. [samples]
    origin : Origin
        Where it likely begins, places as in `members`.
    """

    members: tuple[int, ...]
    period: float
    similarity: float
    coherence: tuple[float, ...]
    own: tuple[bool, ...]
    loops: tuple[LoopEvidence, ...]
    nonlinear: tuple[Nonlinearity, ...]
    compared: tuple[int, ...]
    signals: Real
    arrows: Granger
    delays: tuple[Propagation, ...]
    origin: Origin


def swings_of(grid: Grid, *, seed: int = 0) -> tuple[Swing, ...]:
    """Find the oscillations that loops share, the largest group first.

    Parameters
    ----------
    grid : Grid
        Loops at the same instants.
    seed : int
        Seed of surrogates and shifts.
    """
    own = [oscillation(row, grid.dt) for row in grid.error]
    periods = np.array([_period(one) / grid.dt for one in own])
    found = shared_oscillations(grid.error, periods)
    taken = {place for one in found for place in one.members}
    cores = [(one.members, one.period, one.similarity) for one in found]
    # A loop that alone shows an oscillation may still make others feel it, the clearest first; or
    # it feels one of a group, and what it shows of its own is something else.
    alone = [place for place in np.flatnonzero(np.isfinite(periods)).tolist() if place not in taken]
    alone.sort(key=lambda place: -_share(own[place]))
    cores += [((place,), float(periods[place]), 1.0) for place in alone]
    swings = []
    for members, period, similarity in cores:
        if len(members) == 1 and members[0] in taken:
            continue
        swing = _swing(grid, own, members, period, similarity, taken, seed)
        if swing is not None:
            swings.append(swing)
            taken |= {*swing.members}
    return tuple(sorted(swings, key=lambda one: -len(one.members)))


def _period(found: Oscillation) -> float:
    return np.nan if found.main is None else found.main.period


def _swing(
    grid: Grid,
    own: Sequence[Oscillation],
    core: tuple[int, ...],
    period: float,
    similarity: float,
    taken: set[int],
    seed: int,
) -> Swing | None:
    best = max(core, key=lambda place: _share(own[place]))
    by_error = felt(grid.error[best], grid.error, period)
    by_pv = felt(grid.error[best], grid.pv, period)
    by_error[best] = 1.0
    coherence = np.maximum(by_error, by_pv)
    members = [
        place
        for place in range(len(own))
        if place in core or (place not in taken and coherence[place] > 0)
    ]
    if len(members) < 2:
        return None
    # Behind a moving set point it is PV and not the error that shows what a loop feels.
    signals = np.array(
        [grid.pv[k] if by_pv[k] > by_error[k] + 1e-9 else grid.error[k] for k in members]
    )
    signals -= np.mean(signals, axis=1, keepdims=True)
    nonlinear = tuple(nonlinearity(row, period, seed=seed) for row in signals)
    loops = tuple(
        LoopEvidence(
            share=_share_at(row, period),
            nonlinearity=index.index,
            stiction=_sticking(grid, place, own[place], period),
        )
        for row, index, place in zip(signals, nonlinear, members, strict=True)
    )
    order = np.argsort(-coherence[members], kind="stable")[:MOST_COMPARED]
    compared = tuple(sorted(int(k) for k in order))
    chosen = signals[list(compared)]
    seen = _thinned(chosen, period)
    arrows = _among_different(chosen, seen, seed)
    delays = propagation(chosen, period)
    return Swing(
        members=tuple(members),
        period=period,
        similarity=similarity,
        coherence=tuple(coherence[members].tolist()),
        own=tuple(place in core for place in members),
        loops=loops,
        nonlinear=nonlinear,
        compared=compared,
        signals=seen,
        arrows=arrows,
        delays=delays,
        origin=_among(len(members), compared, loops, arrows, delays, period),
    )


def _among(
    count: int,
    compared: tuple[int, ...],
    loops: Sequence[LoopEvidence],
    arrows: Granger,
    delays: Sequence[Propagation],
    period: float,
) -> Origin:
    """Weigh the loops that were compared; those left out feel it least and get nothing."""
    found = origin([loops[k] for k in compared], arrows, delays, period)
    probabilities = [0.0] * count
    for place, probability in zip(compared, found.probabilities, strict=True):
        probabilities[place] = probability
    return Origin(
        probabilities=tuple(probabilities),
        elsewhere=found.elsewhere,
        named=None if found.named is None else compared[found.named],
    )


def _share(found: Oscillation) -> float:
    return 0.0 if found.main is None else found.main.share


def thinning(period: float) -> int:
    """Count the samples that are averaged to one, so that a cycle has about a score.

    Parameters
    ----------
    period : float
        Period. [samples]
    """
    return max(int(period // A_CYCLE), 1)


def _thinned(signals: Real, period: float) -> Real:
    """Average to a score of samples a cycle, of the last cycles."""
    step = thinning(period)
    last = signals[:, -int(MOST_CYCLES * period) :]
    rows, n = last.shape
    return np.asarray(np.mean(last[:, : n // step * step].reshape(rows, -1, step), axis=2))


def _share_at(signal: Real, period: float) -> float:
    """Part of the variance in the octave around the period."""
    power = np.abs(np.fft.rfft(signal * np.hanning(signal.size))[1:]) ** 2
    order = np.arange(1, power.size + 1) * period / signal.size
    total = float(np.sum(power))
    inside = (order > 1 / OCTAVE) & (order < OCTAVE)
    return float(np.sum(power[inside])) / total if total > 0 else 0.0


def _sticking(grid: Grid, place: int, found: Oscillation, period: float) -> float | None:
    """Probability that the valve of a loop sticks, None where that cannot be judged."""
    op = grid.op[place]
    if np.count_nonzero(np.isfinite(op)) < 2 or not np.ptp(op[np.isfinite(op)]) > 0:
        return None
    op = bridged(op)
    # The range of OP is not known here: far enough off that no sample counts as saturated.
    span = float(np.ptp(op))
    stretch = controlled_stretch(
        LoopSignals(
            dt=grid.dt, pv=grid.pv[place], op=op, sp=grid.pv[place] + grid.error[place],
            mode=grid.mode[place], op_range=(float(np.min(op)) - span, float(np.max(op)) + span),
        )
    )  # fmt: skip
    if stretch is None:
        return None
    same = found if stretch.error.size == op.size else oscillation(stretch.error, grid.dt)
    # The integral of a controller smooths OP: it may show what noise hides in the error. What shows
    # the group's oscillation for longer, and above more of the rest, is looked at.
    smooth = oscillation(stretch.op, grid.dt)
    if _shown(smooth, period * grid.dt) > _shown(same, period * grid.dt):
        same = smooth
    return stiction(stretch, same, op_span=3 * span, integrating=grid.levels[place]).probability


def _shown(found: Oscillation, period: float) -> float:
    """How long and how clearly the group's oscillation is the strongest one; period in seconds."""
    main = found.main
    if main is None or abs(main.period - period) > SAME_PERIOD * period:
        return 0.0
    return main.share * (main.end - main.start)


def _among_different(signals: Real, seen: Real, seed: int) -> Granger:
    """Test who predicts whom, loops that show one and the same signal taken as one.

    Two loops on one transmitter tell the same: with the one allowed for, the other adds nothing,
    and both would lose their arrows.
    """
    same = np.abs(np.corrcoef(signals)) >= THE_SAME
    first = np.argmax(same, axis=1)
    different = np.unique(first)
    found = granger(seen[different], seed=seed)
    if different.size == len(signals):
        return found
    twins = [np.flatnonzero(first == place) for place in different]
    return replace(
        found,
        arrows=tuple(
            replace(arrow, cause=int(cause), effect=int(effect))
            for arrow in found.arrows
            for cause in twins[arrow.cause]
            for effect in twins[arrow.effect]
        ),
    )
