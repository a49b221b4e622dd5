"""Where to start a fit in closed loop: a grid of time constants and dead times, whitened.

The difference between PV and the best model of the grid is described by an autoregression, the
data are whitened by it and the grid is searched again.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import maximum_filter
from scipy.signal import lfilter

from identification.even_stretches import Stretch
from loop.signals import Real

# Ratios of neighbours in the grid of time constants and dead times.
TAU_RATIO, THETA_RATIO = 1.6, 1.15
# Rounds of whitening.
ROUNDS = 2
# Peaks of the grid that are followed.
MOST_PEAKS = 3
# Autoregressions of up to this order are tried.
MOST_ORDER = 12
# Time constants after which nothing is left, as in `held_input`.
LONGEST = 100.0


def lag_samples(op: Real, dt: float, tau: float, theta: float) -> Real:
    """Answer of e^(-theta s)/(tau s + 1) to a held output at its samples, from rest at op[0].

    x[k+1] = a x[k] + (1 - m) u[k-d] + (m - a) u[k-d-1] with a = e^(-dt/tau),
    m = e^(-(dt - f)/tau), theta = d dt + f, 0 <= f < dt

    Parameters
    ----------
    op : ndarray, shape (n,)
        Output, held until the next sample. [OP]
    dt : float
        Spacing of the samples. [s]
    tau, theta : float
        Time constant and dead time. [s]

    Returns
    -------
    ndarray, shape (n,)
        As a deviation from op[0]. [OP]
    """
    d = int(theta / dt)
    f = theta - d * dt
    a, m = math.exp(-dt / tau), math.exp(-(dt - f) / tau)
    moved = np.zeros(op.size)
    if d < op.size:
        moved[d:] = op[: op.size - d] - op[0]
    return np.asarray(lfilter([0.0, 1 - m, m - a], [1.0, -a], moved))


def dying(n: int, dt: float, tau: float) -> Real:
    """e^(-t/tau) at n samples, what is left of a start off rest. [-]"""
    return np.asarray(np.exp(-np.minimum(np.arange(n) * (dt / tau), LONGEST)))


def whiten(columns: Real, noise: Real) -> Real:
    """Apply 1 - sum noise[j] q^-(1+j) to columns, from row p on.

    Parameters
    ----------
    columns : ndarray, shape (n,) or (n, m)
        Signals.
    noise : ndarray, shape (p,)
        Autoregression. [-]

    Returns
    -------
    ndarray, shape (n - p,) or (n - p, m)
    """
    p, n = noise.size, columns.shape[0]
    white = columns[p:].copy()
    for j, a in enumerate(noise.tolist()):
        white -= a * columns[p - 1 - j : n - 1 - j]
    return white


def autoregression(residuals: list[Real]) -> Real:
    """Fit one autoregression to all residuals, its order from 1 on by BIC.

    Parameters
    ----------
    residuals : list of ndarray
        Residual of every stretch. [PV]

    Returns
    -------
    ndarray, shape (p,)
        Coefficients. [-]
    """
    p = max(min(MOST_ORDER, min(r.size for r in residuals) // 8), 1)
    rows = np.concatenate(
        [np.column_stack([*(r[p - 1 - j : r.size - 1 - j] for j in range(p)), r[p:]])
         for r in residuals]
    )  # fmt: skip
    R: Real = np.asarray(np.linalg.qr(rows, mode="r"))
    n = rows.shape[0]
    sums = np.maximum(np.cumsum(R[::-1, -1] ** 2)[::-1], np.finfo(np.float64).tiny)
    criterion = n * np.log(sums / n) + math.log(n) * np.arange(p + 1)
    order = 1 + int(np.argmin(criterion[1:]))
    return np.asarray(np.linalg.lstsq(R[:order, :order], R[:order, -1], rcond=None)[0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Start:
    """Where to start a fit from.

    Attributes
    ----------
    tau, theta : float
        Time constant and dead time. [s]
    noise : ndarray, shape (p,)
        Autoregression of the disturbance. [-]
    """

    tau: float
    theta: float
    noise: Real


def search(
    stretches: tuple[Stretch, ...], dt: float, *, slowest: float, latest: float, noise: Real
) -> list[Start]:
    """Search the grid, whitening round by round; the best start first, then its rivals.

    Parameters
    ----------
    stretches : tuple of Stretch
        Samples.
    dt : float
        Their spacing. [s]
    slowest, latest : float
        Largest time constant and dead time. [s]
    noise : ndarray, shape (p,)
        Autoregression to begin with; empty for none. [-]
    """
    grid = _Grid.of(stretches, dt, slowest, latest)
    peaks: list[tuple[float, float]] = []
    for _ in range(ROUNDS):
        peaks = grid.peaks(noise)
        noise = autoregression(grid.residuals(*peaks[0], noise))
    return [Start(tau=tau, theta=theta, noise=noise) for tau, theta in peaks]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Grid:
    stretches: tuple[Stretch, ...]
    dt: float
    delays: list[int]
    answers: dict[float, list[Real]]

    @classmethod
    def of(
        cls, stretches: tuple[Stretch, ...], dt: float, slowest: float, latest: float
    ) -> "_Grid":
        most = int(latest / dt)
        delays = [0]
        while delays[-1] < most:
            delays.append(min(max(delays[-1] + 1, int(delays[-1] * THETA_RATIO)), most))
        count = 2 + int(math.log(slowest / dt) / math.log(TAU_RATIO))
        answers = {}
        for tau in np.geomspace(dt, slowest, count).tolist():
            answers[tau] = [
                np.concatenate((np.zeros(max(most - s.lead, 0)), lag_samples(s.op, dt, tau, 0.0)))
                for s in stretches
            ]
        return cls(stretches=stretches, dt=dt, delays=delays, answers=answers)

    def peaks(self, noise: Real) -> list[tuple[float, float]]:
        """Where the whitened PV is explained best, and the next best peaks. [s]"""
        taus = list(self.answers)
        fixed = [
            whiten(np.stack((np.ones(s.pv.size), s.pv - s.pv.mean()), axis=1), noise)
            for s in self.stretches
        ]
        score = np.array([self._scores(tau, noise, fixed) for tau in taus])
        found = np.flatnonzero(score == maximum_filter(score, 3))
        order = found[np.argsort(-score.flat[found])][:MOST_PEAKS].tolist()
        places = [divmod(i, len(self.delays)) for i in order]
        return [(taus[i], self.delays[j] * self.dt) for i, j in places]

    def _scores(self, tau: float, noise: Real, fixed: list[Real]) -> Real:
        """Explained part at every dead time; `fixed` is level and PV of each stretch, whitened."""
        inner, size, left = 0.0, np.zeros(len(self.delays)), 0.0
        delays = np.array(self.delays)
        for s, x, (level, pv) in zip(
            self.stretches, self.answers[tau], (f.T for f in fixed), strict=True
        ):
            gone = whiten(dying(s.pv.size, self.dt, tau), noise)
            q = _orthonormal(np.stack((level, gone), axis=1))
            y = pv - q @ (q.T @ pv)
            moved = whiten(x, noise)
            first = moved.size - y.size
            X = sliding_window_view(moved, y.size)[first - delays]
            onto = X @ np.column_stack((y, q))
            inner = inner + onto[:, 0]
            size += np.einsum("ij,ij->i", X, X) - np.sum(onto[:, 1:] ** 2, axis=1)
            left += float(y @ y)
        return np.asarray(inner**2 / np.maximum(size, 1e-300)) - left

    def residuals(self, tau: float, theta: float, noise: Real) -> list[Real]:
        """PV less the best model at a point of the grid, for every stretch."""
        blocks = columns(self.stretches, self.dt, tau, theta)
        y = [s.pv - s.pv.mean() for s in self.stretches]
        white = np.concatenate([whiten(block, noise) for block in blocks])
        a, *_ = np.linalg.lstsq(white, np.concatenate([whiten(v, noise) for v in y]), rcond=None)
        return [v - block @ a for v, block in zip(y, blocks, strict=True)]


def _orthonormal(pair: Real) -> Real:
    """Two columns made orthonormal, zero where one contains the other."""
    q = pair.copy()
    for k in range(2):
        before = float(q[:, k] @ q[:, k])
        if k:
            q[:, 1] -= q[:, 0] * float(q[:, 0] @ q[:, 1])
        size = float(q[:, k] @ q[:, k])
        q[:, k] *= 0.0 if size <= 1e-12 * before else 1 / math.sqrt(size)
    return q


def columns(stretches: tuple[Stretch, ...], dt: float, tau: float, theta: float) -> list[Real]:
    """Answer, then level and start off rest of every stretch, one block for each stretch.

    Parameters
    ----------
    stretches : tuple of Stretch
        Samples, s of them.
    dt, tau, theta : float
        Spacing, time constant, dead time. [s]

    Returns
    -------
    list of ndarray, shape (n, 1 + 2 s)
    """
    blocks: list[Real] = []
    for i, s in enumerate(stretches):
        n = s.pv.size
        block = np.zeros((n, 1 + 2 * len(stretches)))
        block[:, 0] = lag_samples(s.op, dt, tau, theta)[s.lead :]
        block[:, 1 + 2 * i] = 1.0
        block[:, 2 + 2 * i] = dying(n, dt, tau)
        blocks.append(block)
    return blocks
