"""Granger causality: does the past of one loop tell what another will do, beyond all the others?"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import betainc

from loop.regression import lagged
from loop.signals import Real
from monitoring.phase_locking import moving

# Largest order that is considered, and the part of the rows that coefficients may be: settings.
MOST_LAGS = 12
ROWS_A_COEFFICIENT = 10
FEWEST_ROWS = 60
# A false arrow in a hundred groups by the F test; beyond every one of the shifted causes as well,
# and beyond their mean by three standard deviations.
FALSE_ARROWS = 0.01
SHIFTS = 39
BEYOND = 3.0
SMALLEST = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, slots=True, kw_only=True)
class GrangerArrow:
    """What the past of one signal adds to the prediction of another.

    Attributes
    ----------
    cause, effect : int
        Places of the signals, in the order given.
    strength : float
        ln(residual sum of squares without the cause / with it). [-]
    p_value : float
        Chance of such an F or a larger one where the cause adds nothing. [-]
    beyond : float or None
        Standard deviations by which the strength exceeds its mean over causes shifted in time;
        None where the F test sees nothing and no shift was tried. [-]
    significant : bool
        Both tests agree that the cause adds something.
    """

    cause: int
    effect: int
    strength: float
    p_value: float
    beyond: float | None
    significant: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Granger:
    """Who predicts whom.

    Attributes
    ----------
    arrows : tuple of GrangerArrow
        Every ordered pair; empty where nothing can be said.
    order : int or None
        Lags of every signal, by BIC. [samples]
    conditional : bool
        The pasts of all other signals were allowed for; otherwise pairs were looked at alone.
    reason : str
        Why there are no arrows; empty otherwise.
    """

    arrows: tuple[GrangerArrow, ...]
    order: int | None
    conditional: bool
    reason: str = ""

    def drives(self, cause: int, effect: int) -> bool:
        """Whether both tests see an arrow from one signal to the other."""
        return any(
            one.significant and one.cause == cause and one.effect == effect for one in self.arrows
        )


def granger(signals: Real, *, most_lags: int = MOST_LAGS, seed: int = 0) -> Granger:
    """Test every ordered pair of signals for Granger causality [1]_.

    Each signal is regressed on p past values of all signals, once with and once without those of
    the cause:

        strength = ln(RSS_without / RSS_with)
        F = ((RSS_without - RSS_with) / p) / (RSS_with / (n - k))

    with n rows and k coefficients. In a limit cycle everything predicts everything: what a signal
    repeats for ever can be told from any other that repeats with it. So the same is done with the
    cause shifted around a circle by random times: it then has the same cycle, but not the same
    moments. Only where F is significant and the true cause beats its shifted selves there is an
    arrow.

    Parameters
    ----------
    signals : ndarray, shape (m, n)
        Signals at the same instants, without gaps, a dozen or two samples a cycle.
    most_lags : int
        Largest order. [samples]
    seed : int
        Seed of the shifts.

    Raises
    ------
    ValueError
        The signals are not rows of finite numbers.

    References
    ----------
    .. [1] C. W. J. Granger, "Investigating causal relations by econometric models and
       cross-spectral methods", Econometrica 37 (1969); definition from memory.
    """
    signals = np.asarray(signals, dtype=np.float64)
    if signals.ndim != 2 or not np.all(np.isfinite(signals)):
        raise ValueError("signals must be rows of finite numbers, gaps bridged or left out")
    m, n = signals.shape
    if m < 2:
        return _nothing("a single loop has nobody to be driven by")
    moves = moving(signals)
    if not np.all(moves):
        return _nothing(f"signal {int(np.argmin(moves)) + 1} does not move")
    most = min(most_lags, int((n / ROWS_A_COEFFICIENT - 1) // 2))
    if most < 1 or n - most < FEWEST_ROWS:
        return _nothing(f"{n} samples are too few to regress on the past")
    scaled = signals - np.mean(signals, axis=1, keepdims=True)
    scaled /= np.std(scaled, axis=1, keepdims=True)
    # With the others allowed for, m pasts need their rows.
    conditional = m > 2 and n >= ROWS_A_COEFFICIENT * (m * min(most, 4) + 1)
    # The same shifts for every pair: the order of the signals then changes nothing.
    away = np.random.default_rng(seed).integers(n // 10, n - n // 10, SHIFTS).tolist()
    if conditional or m == 2:
        most = min(most, int((n / ROWS_A_COEFFICIENT - 1) // m))
        order = var_order(scaled, most)
        pairs = [(j, i) for j in range(m) for i in range(m) if i != j]
        arrows = [_arrow(scaled, j, i, order, len(pairs), away) for j, i in pairs]
        return Granger(arrows=tuple(arrows), order=order, conditional=conditional)
    arrows, orders = [], []
    for i in range(m):
        for j in range(m):
            if i != j:
                pair = scaled[[j, i]]
                orders.append(var_order(pair, most))
                one = _arrow(pair, 0, 1, orders[-1], m * (m - 1), away)
                arrows.append(_renamed(one, j, i))
    return Granger(arrows=tuple(arrows), order=max(orders), conditional=False)


def _nothing(reason: str) -> Granger:
    return Granger(arrows=(), order=None, conditional=False, reason=reason)


def _renamed(arrow: GrangerArrow, cause: int, effect: int) -> GrangerArrow:
    return GrangerArrow(
        cause=cause, effect=effect, strength=arrow.strength, p_value=arrow.p_value,
        beyond=arrow.beyond, significant=arrow.significant,
    )  # fmt: skip


def var_order(signals: Real, most: int) -> int:
    """Choose the order of a vector autoregression by BIC, 1 to `most`, all on the same rows.

    n ln det(residual covariance) + coefficients ln n; one QR factorisation holds every order.

    Parameters
    ----------
    signals : ndarray, shape (m, n)
        Signals without gaps.
    most : int
        Largest order. [samples]
    """
    m, n = signals.shape
    # A lag at a time over all signals, so that every order is a part of the next.
    past = [np.roll(signals, k, axis=1).T for k in range(1, most + 1)]
    X = np.column_stack([np.ones(n), *past, signals.T])[most:]
    R: Real = np.asarray(np.linalg.qr(X, mode="r"))
    rows = n - most
    worth = []
    for p in range(1, most + 1):
        k = 1 + m * p
        left = R[k:, 1 + m * most :]
        _, log_det = np.linalg.slogdet(left.T @ left / rows + 1e-12 * np.eye(m))
        worth.append(rows * log_det + m * k * np.log(rows))
    return int(np.argmin(worth)) + 1


def _arrow(
    signals: Real, cause: int, effect: int, order: int, pairs: int, away: Sequence[int]
) -> GrangerArrow:
    n = signals.shape[1]
    lags = range(1, order + 1)
    others = [lagged(row, lags) for k, row in enumerate(signals) if k != cause]
    known = np.column_stack([np.ones(n), *others])[order:]
    Q = np.linalg.qr(known)[0]
    left = signals[effect, order:] - Q @ (Q.T @ signals[effect, order:])
    without = float(left @ left)

    def gain(source: Real) -> float:
        past = np.column_stack([np.roll(source, lag) for lag in lags])[order:]
        past -= Q @ (Q.T @ past)
        R: Real = np.asarray(np.linalg.qr(np.column_stack([past, left]), mode="r"))
        return float(np.log(without / max(float(R[-1, -1]) ** 2, SMALLEST)))

    strength = gain(signals[cause])
    k = known.shape[1] + order
    freedom = n - order - k
    F = np.expm1(strength) * freedom / order
    p_value = f_tail(float(F), order, freedom)
    if p_value > FALSE_ARROWS / pairs:
        return GrangerArrow(
            cause=cause, effect=effect, strength=strength, p_value=p_value, beyond=None,
            significant=False,
        )  # fmt: skip
    shifted: Real = np.array([gain(np.roll(signals[cause], shift)) for shift in away])
    beyond = (strength - float(np.mean(shifted))) / max(float(np.std(shifted, ddof=1)), 1e-12)
    return GrangerArrow(
        cause=cause, effect=effect, strength=strength, p_value=p_value, beyond=beyond,
        significant=bool(beyond > BEYOND and strength > np.max(shifted)),
    )  # fmt: skip


def f_tail(F: float, between: int, within: int) -> float:
    """Chance of an F or a larger one, I_x(within/2, between/2) at x = within/(within + between F).

    Parameters
    ----------
    F : float
        Ratio of mean squares. [-]
    between, within : int
        Degrees of freedom of its numerator and denominator.
    """
    return float(betainc(within / 2, between / 2, within / (within + between * max(F, 0.0))))
