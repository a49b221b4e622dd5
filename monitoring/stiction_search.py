"""Stiction S and slip jump J that explain OP and PV best: a search, for flagged loops only."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real
from loop.valve import Kano, stem_positions
from monitoring.basis import Basis, graded, refusal

MOST_CYCLES = 20
MOST_SAMPLES = 800
FEWEST_SAMPLES = 60
SLIPS = np.linspace(0.0, 1.0, 6)
SIZES = 12
# A valve is worth its two parameters where it takes off this part of the linear model's residual.
CLEAR = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class StictionSearch:
    """Hammerstein model: valve, then ARX.

    Attributes
    ----------
    S, J : float or None
        Stiction band and slip jump; None where the valve explains no more than a line. S comes
        back within a fifth or so from simulated loops; J is far less certain. [OP]
    improvement : float or None
        Part of the linear model's residual variance that the valve takes off. [-]
    delay : int or None
        Delay of the ARX model. [samples]
    basis : Basis
        What this rests on.
    """

    S: float | None
    J: float | None
    improvement: float | None
    delay: int | None
    basis: Basis


def stiction_search(op: Real, pv: Real, period: float) -> StictionSearch:
    """Search S and J of a Kano valve before y[t] = a1 y[t-1] + a2 y[t-2] + b v[t-d] + c [1]_.

    The ARX part is fitted by least squares for every valve and delay; a second, finer grid goes
    around the best of the first. The last twenty cycles are used, thinned to 800 samples.

    Parameters
    ----------
    op, pv : ndarray, shape (n,)
        Output and process variable without gaps. [OP], [PV]
    period : float
        Period of the oscillation. [samples]

    References
    ----------
    .. [1] M. Jelali, "Estimation of valve stiction in control loops using separable
       least-squares and global search algorithms", Journal of Process Control 18 (2008); from
       memory, with a grid as the global search.
    """
    settings = (("cycles at most", float(MOST_CYCLES)), ("clear improvement", CLEAR))
    window = int(MOST_CYCLES * period)
    rate = max(-(-min(window, op.size) // MOST_SAMPLES), 1)
    u, y = (_thinned(signal[-window:], rate) for signal in (op, pv))
    reach = float(np.ptp(u))
    if u.size < FEWEST_SAMPLES or not (reach > 0 and np.ptp(y) > 0):
        return StictionSearch(
            S=None, J=None, improvement=None, delay=None,
            basis=refusal("too few samples, or OP or PV does not move", settings=settings),
        )  # fmt: skip
    delays = sorted({1, 2, 3, *np.linspace(1, max(period / rate / 4, 2), 6).astype(int).tolist()})
    linear = float(_residuals(u[:, None], y, delays).min())
    sizes = np.linspace(0.0, 1.0, SIZES + 1)[1:] * reach
    S, J, delay, _ = _best(u, y, delays, sizes, SLIPS)
    finer = S + np.linspace(-1, 1, 9) * reach / SIZES
    S, J, delay, residual = _best(
        u, y, delays, finer[finer > 0], np.clip(J / S + np.linspace(-0.2, 0.2, 5), 0, 1)
    )
    improvement = 1 - residual / linear if linear > 0 else 0.0
    clear = improvement > CLEAR
    doubts = () if clear else ("a valve without friction explains the data as well",)
    return StictionSearch(
        S=S if clear else None,
        J=J if clear else None,
        improvement=float(improvement),
        delay=delay * rate,
        basis=graded(min(window / op.size, 1.0), doubts, settings=settings),
    )


def _thinned(signal: Real, rate: int) -> Real:
    return signal[::rate]


def _best(
    u: Real, y: Real, delays: list[int], sizes: Real, slips: Real
) -> tuple[float, float, int, float]:
    """Best S, J and delay on a grid, and the residual."""
    S, part = (grid.ravel() for grid in np.meshgrid(sizes, slips, indexing="ij"))
    stems = stem_positions(Kano(S=S, J=part * S), u)
    found = _residuals(stems, y, delays)
    row, column = np.unravel_index(int(np.argmin(found)), found.shape)
    k = int(column)
    return float(S[k]), float(part[k] * S[k]), delays[int(row)], float(found[row, k])


def _residuals(stems: Real, y: Real, delays: list[int]) -> Real:
    """Residual variance of the ARX fit, shape (delays, valves)."""
    latest = max(delays) + 1
    target = y[latest:]
    own = np.stack([y[latest - 1 : -1], y[latest - 2 : -2], np.ones(target.size)], axis=1)
    Q, _ = np.linalg.qr(own)
    rest = target - Q @ (Q.T @ target)
    power = float(rest @ rest)
    out = np.empty((len(delays), stems.shape[1]))
    for row, delay in enumerate(delays):
        v = stems[latest - delay : stems.shape[0] - delay]
        v = v - Q @ (Q.T @ v)
        size = np.einsum("ij,ij->j", v, v)
        gain = np.divide((rest @ v) ** 2, size, out=np.zeros(size.size), where=size > 0)
        out[row] = power - gain
    return np.asarray(np.maximum(out, 0.0) / target.size)
