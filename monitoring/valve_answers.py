"""Does PV answer what OP does? Numbers that need no cycle and are defined for every window.

A window is cut into block means: fine where OP turns often, coarse where it moves slowly. All
definitions are own ones.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from loop.signals import Real
from monitoring.controller_moves import controller_moves
from monitoring.cross_correlation import correlations
from monitoring.error_excursions import error_excursions
from monitoring.sensor import noise_level

# Blocks that are looked at; at least so many where blocks are widened because OP moves slowly, and
# so many for every half swing of OP.
MOST_BLOCKS, FEWEST_BLOCKS, A_HALF_SWING = 1500, 100, 12
# The noise of PV is taken from so many samples, the last ones.
NOISE_SAMPLES = 8192
# OP turns where it comes back by this part of its range.
TURN, LEG = 0.25, 0.15
# Widths of lost motion that are tried, in parts of OP's range in the window.
WIDTHS = np.array([0.0, 0.04, 0.08, 0.12, 0.18, 0.25, 0.33, 0.42, 0.52, 0.63, 0.75, 0.88])
# PV is explained by this many of its own blocks and so many of OP before it.
OWN_PAST, OP_PAST = 6, 3
# An error is seen beyond so many standard deviations of noise, and has stayed where this part of
# it is still there.
SEEN, STAYED = 3.0, 0.6
FEWEST_SAMPLES = 100
# A sound valve has a dead band too: OP that moves by less than this part of its range proves
# nothing.
LEAST_MOVE = 5e-3
TINY, SHORTEST_STAY = 1e-12, 1e-3

NAMES = (
    "correlation",
    "correlation of the moves",
    "correlation with the sign of the process",
    "what OP adds, log",
    "what lost motion adds, log",
    "width of the lost motion",
    "what OP explains at once, root",
    "reversion of the error, log",
    "unanswered travel",
    "slow error over noise, log",
    "crossings of the error, log",
    "jumps of PV over those of OP, log",
    "PV still while OP moves",
    "integral over proportional action",
    "turns of OP, log",
    "PV over noise, log",
    "error over PV, log",
    "integrating",
    "OP's moves explained by PI action, root",
    "proportional action, log",
    "integral action, log",
    "integral time over window, log",
    "excursions of the error, log",
    "longest excursion over window, log",
    "energy of excursions beyond three Ti",
    "error left in an excursion",
    "first zero of the error's autocorrelation over window, log",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ValveAnswers:
    """How PV answers the movement of OP in one window.

    Attributes
    ----------
    block : int
        Samples of a block. [samples]
    half_swing : float
        Mean time between two turns of OP. [samples]
    correlation : float
        Largest |correlation| of OP and PV, PV up to an eighth of the window before or behind. [-]
    lost_motion : float
        n log of the residual variance of PV by OP over that by OP behind lost motion. [-]
    width : float
        Best width of the lost motion, in parts of OP's range in the window. [-]
    unanswered : float
        Part of OP's travel during which the error that drove it stayed. [-]
    still : float
        Part of OP's moves between samples in which PV kept its very value. [-]
    op_range : float
        Range of OP in the window over the range of the output. [-]
    vector : ndarray, shape (k,)
        All numbers in the order of `NAMES`.
    """

    block: int
    half_swing: float
    correlation: float
    lost_motion: float
    width: float
    unanswered: float
    still: float
    op_range: float
    vector: Real


def valve_answers(
    op: Real,
    pv: Real,
    error: Real,
    *,
    op_span: float,
    integrating: bool,
    period: float | None = None,
) -> ValveAnswers | None:
    """Measure how PV answers OP.

    Parameters
    ----------
    op, pv, error : ndarray, shape (n,)
        Signals without gaps. [OP], [PV], [PV]
    op_span : float
        Range of the output. [OP]
    integrating : bool
        Whether the process integrates.
    period : float, optional
        Period of the main oscillation: a long record is then cut to its last part, not
        coarsened beyond it. [samples]

    Returns
    -------
    ValveAnswers or None
        None for fewer than 100 samples, or where OP or PV does not move at all.
    """
    if op.size < FEWEST_SAMPLES or not (np.ptp(op) > 0 and np.ptp(pv) > 0):
        return None
    first = max(op.size // MOST_BLOCKS, 1)
    if period is not None:
        first = min(first, max(int(period / 2 / A_HALF_SWING), 1))
    noise = _noise(pv[-NOISE_SAMPLES:])
    part = slice(-MOST_BLOCKS * first, None)
    u, y, e = (block_means(signal[part], first) for signal in (op, pv, error))
    control = _control(u, e, noise / np.sqrt(first))
    turns = len(turning_points(u, TURN * float(np.ptp(u))))
    widest = max(u.size // FEWEST_BLOCKS, 1)
    rate = int(np.clip(u.size / (turns + 1) / A_HALF_SWING, 1, widest))
    u, y, e = (block_means(signal, rate) for signal in (u, y, e))
    block = first * rate
    quiet = max(
        noise / np.sqrt(block), 0.3 * noise_level(y), 1e-3 * float(np.std(y)), TINY
    )  # a block's noise, never quite none
    rho, rho_signed = _correlation(u, y, e)
    moves = correlations(np.diff(u), np.diff(y), max((u.size - 1) // 8, 1))
    adds, lost, width, at_once = _what_op_adds(u, y)
    unanswered, still = _unanswered(u, e, quiet), _still(op[part], pv[part])
    vector = np.array([
        rho,
        0.0 if moves is None else float(np.max(np.abs(moves))),
        rho_signed,
        np.log1p(adds),
        np.log1p(lost),
        width,
        np.sqrt(at_once),
        _reversion(e),
        unanswered,
        _slow_error(e, quiet),
        np.log1p(_crossings(e, quiet)),
        np.log(_kurtosis(y[3:] - y[:-3]) / _kurtosis(u[3:] - u[:-3])),
        still,
        _squared_correlation(np.cumsum(e), u) - _squared_correlation(e, u),
        np.log1p(turns),
        min(np.log10(np.std(y) / quiet + 0.1), 4.0),
        np.log(np.var(e) / max(float(np.var(y)), TINY) + 1e-3),
        float(integrating),
        *control,
    ])  # fmt: skip
    return ValveAnswers(
        block=block,
        half_swing=u.size * block / (turns + 1),
        correlation=rho,
        lost_motion=lost,
        width=width,
        unanswered=unanswered,
        still=still,
        op_range=float(np.ptp(op) / op_span),
        vector=vector,
    )


def _control(u: Real, e: Real, noise: float) -> tuple[float, ...]:
    """What the controller does with the error, and how long the error stays all the same."""
    moves = controller_moves(u, e)
    stays = error_excursions(e, noise, moves.Ti)
    return (
        moves.explained,
        np.log(moves.proportional),
        np.log(moves.integral),
        np.log(moves.Ti / u.size),
        np.log1p(stays.count),
        np.log(stays.longest + SHORTEST_STAY),
        stays.long_share,
        stays.left,
        np.log(stays.first_crossing + SHORTEST_STAY),
    )


def _noise(pv: Real) -> float:
    """White noise of PV, and what its rounding makes of none."""
    steps = np.abs(np.diff(pv))
    steps = steps[steps > 0]
    rounding = float(np.quantile(steps, 0.02)) / np.sqrt(12) if steps.size else 0.0
    return max(noise_level(pv), rounding)


def _still(op: Real, pv: Real) -> float:
    moved = np.diff(op) != 0
    count = int(np.count_nonzero(moved))
    return float(np.count_nonzero(moved & (np.diff(pv) == 0)) / count) if count else 0.0


def block_means(signal: Real, size: int) -> Real:
    """Means of `size` samples each, counted from the end."""
    if size == 1:
        return signal
    n = signal.size // size
    return np.asarray(signal[signal.size - n * size :].reshape(n, size).mean(axis=1))


def turning_points(signal: Real, hysteresis: float) -> list[int]:
    """Places at which a signal turns and comes back by more than a hysteresis.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Signal without gaps.
    hysteresis : float
        How far it must come back, in the signal's unit.
    """
    found: list[int] = []
    values = signal.tolist()
    high = low = values[0]
    at_high = at_low = way = 0
    for k, value in enumerate(values):
        if way >= 0:
            if value > high:
                high, at_high = value, k
            elif high - value > hysteresis:
                if way > 0:
                    found.append(at_high)
                way, low, at_low = -1, value, k
                continue
        if way <= 0:
            if value < low:
                low, at_low = value, k
            elif value - low > hysteresis:
                if way < 0:
                    found.append(at_low)
                way, high, at_high = 1, value, k
    return found


def behind_lost_motion(op: Real, widths: Real) -> Real:
    """Positions behind lost motion of several widths, shape (n, m).

    The position is the last one, clamped to OP -+ width/2. Clamps after one another are a clamp
    again, so that a scan by doubling takes log2 n steps for all samples and widths together.

    Parameters
    ----------
    op : ndarray, shape (n,)
        Output; the position starts at its first value. [OP]
    widths : ndarray, shape (m,)
        How far OP moves after a turn before the position follows. [OP]
    """
    low, high = op[:, None] - widths / 2, op[:, None] + widths / 2
    shift = 1
    while shift < op.size:
        a, b = low[shift:], high[shift:]
        low, high = (
            np.concatenate([low[:shift], np.clip(low[:-shift], a, b)]),
            np.concatenate([high[:shift], np.clip(high[:-shift], a, b)]),
        )
        shift *= 2
    return np.asarray(np.clip(op[0], low, high))


def _correlation(u: Real, y: Real, e: Real) -> tuple[float, float]:
    """Largest |correlation|, and the same with 1 for a move that the process would make."""
    r = correlations(u, y, max(u.size // 8, 1))
    if r is None:
        return 0.0, 0.0
    largest = float(r[np.argmax(np.abs(r))])
    return abs(largest), largest * _process_sign(u, e)


def _process_sign(u: Real, e: Real) -> float:
    """Sign of the process gain: the controller moves OP by it against the error."""
    moves, steps = u[4:] - u[:-4], np.diff(u)
    mean = np.convolve(e, np.full(4, 0.25), "valid")[: moves.size]
    vote = _cosine(moves, mean) + _cosine(steps, np.diff(e))
    return -1.0 if vote < 0 else 1.0


def _cosine(a: Real, b: Real) -> float:
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0 else 0.0


def _what_op_adds(u: Real, y: Real) -> tuple[float, float, float, float]:
    """What OP's past adds to PV's own, what lost motion adds to that, its width; OP at once."""
    n, reach = y.size, float(np.ptp(u))
    if not (reach > 0 and np.ptp(y) > 0):
        return 0.0, 0.0, 0.0, 0.0
    stems, y = behind_lost_motion(u, WIDTHS * reach) / reach, y / np.std(y)
    target = y[OWN_PAST:]
    own = [y[OWN_PAST - k : n - k] for k in range(1, OWN_PAST + 1)]
    Q, _ = np.linalg.qr(np.stack([*own, np.ones(target.size)], axis=1))
    rest = target - Q @ (Q.T @ target)
    power = float(rest @ rest) + 1e-9 * n
    past = np.stack([stems[OWN_PAST - k : n - k] for k in range(1, OP_PAST + 1)], axis=2)
    past = past - np.tensordot(Q, np.tensordot(Q, past, (0, 0)), (1, 0))
    square = np.einsum("iml,imk->mlk", past, past) + 1e-8 * n * np.eye(OP_PAST)
    along = np.einsum("iml,i->ml", past, rest)
    gain = np.einsum("ml,ml->m", along, np.linalg.solve(square, along[:, :, None])[:, :, 0])
    left = np.maximum(power - gain, 1e-9 * power)
    best = int(np.argmin(left))
    now = stems[OWN_PAST:, 0] - Q @ (Q.T @ stems[OWN_PAST:, 0])
    size = float(now @ now)
    part = float(rest @ now) ** 2 / size / power if size > 1e-9 * n else 0.0
    return (
        float(n * np.log(power / left[0])),
        float(n * np.log(left[0] / left[best])),
        float(WIDTHS[best]),
        float(-np.log(max(1 - part, 1e-6))),
    )


def _reversion(e: Real) -> float:
    """Log of the part of a slow error that is gone after a fiftieth of the window."""
    slow = block_means(e, max(e.size // 100, 1))
    before, moved = slow[:-2], slow[2:] - slow[:-2]
    power = float(before @ before)
    return float(np.log(max(-float(before @ moved) / power, 0.003))) if power > 0 else 0.0


def _unanswered(u: Real, e: Real, noise: float) -> float:
    """Part of OP's travel on ways on which the error, seen beyond noise, stayed as it was."""
    ends = [0, *turning_points(u, LEG * float(np.ptp(u))), u.size - 1]
    travel = stayed = 0.0
    for first, last in pairwise(ends):
        size = abs(float(u[last] - u[first]))
        travel += size
        quarter = (last - first) // 4
        if quarter < 2:
            continue
        reach = quarter // 2
        early, late = (
            float(np.mean(e[place - reach : place + reach + 1]))
            for place in (first + quarter, last - quarter)
        )
        seen = abs(early) > SEEN * noise / np.sqrt(quarter)
        if seen and late * np.sign(early) > STAYED * abs(early):
            stayed += size
    return stayed / travel if travel > 0 else 0.0


def _slow_error(e: Real, noise: float) -> float:
    """Log10 of the power of the slow error over what noise leaves in it."""
    size = max(e.size // 50, 1)
    slow = block_means(e, size)
    return float(np.clip(np.log10(np.mean(slow**2) / (noise**2 / size) + 0.1), -1.0, 5.0))


def _crossings(e: Real, noise: float) -> int:
    return int(np.count_nonzero(np.diff(np.sign(e[np.abs(e) > 2 * noise]))))


def _kurtosis(moves: Real) -> float:
    centred = moves - moves.mean()
    power = float(np.mean(centred**2))
    return float(np.mean(centred**4)) / power**2 if power > 0 else 3.0


def _squared_correlation(a: Real, b: Real) -> float:
    return _cosine(a - a.mean(), b - b.mean()) ** 2
