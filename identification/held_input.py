"""A controller output that is held between moves, and a first-order lag's exact answer to it.

Between two moves the answer of a lag is one decaying exponential, so a record with a few moves
needs one exponential a sample, whatever the sampling and whatever fraction of a sample the dead
time is. Nothing is discretised.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Self, TypeAlias

import numpy as np
import numpy.typing as npt

from loop.signals import Real

Indices: TypeAlias = npt.NDArray[np.intp]

# Time constants after which nothing is left (e^-100 = 4e-44); beyond, an exponential underflows,
# which processors compute ten times slower.
LONGEST = 100.0
# With so few moves within a stretch of samples it is quicker to work from move to move.
FEW = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeldInput:
    """Output levels and the instants at which they change.

    Attributes
    ----------
    instants : ndarray, shape (m,)
        Times of the moves, increasing. [s]
    levels : ndarray, shape (m + 1,)
        Output before the first move and after each one. [OP]
    """

    instants: Real
    levels: Real

    def __post_init__(self) -> None:
        if self.levels.size != self.instants.size + 1:
            raise ValueError(
                f"{self.instants.size} moves need {self.instants.size + 1} levels, "
                f"got {self.levels.size}"
            )
        if (self.instants[1:] <= self.instants[:-1]).any():
            raise ValueError("moves must follow each other in time")

    @classmethod
    def from_samples(cls, t: Real, op: Real, op_before: float | None = None) -> Self:
        """Read every change of a sampled output as a move at the sample that shows it first.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times. [s]
        op : ndarray, shape (n,)
            Output, without gaps. [OP]
        op_before : float, optional
            Output before the first sample, where it is known; where it differs from the first
            sample the output moved at t[0]. [OP]
        """
        moved = np.flatnonzero(op[1:] != op[:-1]) + 1
        instants, levels = t[moved], np.concatenate((op[:1], op[moved]))
        if op_before is not None and op_before != op[0]:
            instants, levels = np.append(t[0], instants), np.append(op_before, levels)
        return cls(instants=instants, levels=levels)

    @classmethod
    def from_holds(cls, t: Real, op: Real, edges: Indices, op_before: float | None = None) -> Self:
        """Average a noisy output over its holds.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times. [s]
        op : ndarray, shape (n,)
            Output, without gaps. [OP]
        edges : ndarray of int, shape (m,)
            Samples at which a new hold begins, increasing; the first may be 0 where `op_before`
            tells what was held until then.
        op_before : float, optional
            Output before the first sample. [OP]
        """
        starts = np.unique(np.append(0, edges))
        means = np.add.reduceat(op, starts) / np.diff(starts, append=op.size)
        if op_before is not None:
            return cls(instants=t[starts], levels=np.append(op_before, means))
        return cls(instants=t[starts[1:]], levels=means)

    @property
    def moves(self) -> int:
        """How often the output changes."""
        return self.instants.size


def lag_states(held: HeldInput, tau: float) -> tuple[Real, Real]:
    """Distance of the lag from the level it heads for, right after each move.

    z_j = z_(j-1) e^(-(t_j - t_(j-1))/tau) - (u_j - u_(j-1)), starting at rest.

    Returns
    -------
    z, dz : ndarray, shape (m + 1,)
        The distance, and its derivative with respect to tau; the first entry is the rest
        before the first move. [OP], [OP/s]
    """
    instants, levels = held.instants.tolist(), held.levels.tolist()
    z, dz = [0.0], [0.0]
    for j, instant in enumerate(instants):
        gap = (instant - instants[j - 1]) / tau if j else 0.0
        decay = math.exp(-gap)
        dz.append((dz[j] + z[j] * gap / tau) * decay)
        z.append(z[j] * decay - (levels[j + 1] - levels[j]))
    return np.array(z), np.array(dz)


def lag_response(
    held: HeldInput,
    t: Real,
    tau: float,
    theta: float,
    *,
    states: tuple[Real, Real] | None = None,
    spread: Real | None = None,
    out: tuple[Real, Real, Real] | None = None,
) -> tuple[Real, Real, Real]:
    """Answer a held input with the lag e^(-theta s)/(tau s + 1), exactly.

    x(t) = u_j + z_j e^(-(t - t_j - theta)/tau) between the moves j and j + 1.

    Parameters
    ----------
    held : HeldInput
        Input, at rest at its first level before its first move.
    t : ndarray, shape (n,)
        Times, increasing. [s]
    tau : float
        Time constant, positive. [s]
    theta : float
        Dead time; a negative one lets the answer precede the move. [s]
    states : tuple of ndarray, optional
        `lag_states(held, tau)`, where it is at hand.
    spread : ndarray, shape (n,), optional
        Variance of the times of some readings about each time; the answer is then their mean. The
        mean of an exponential over times of variance v is (1 + v/(2 tau^2)) times its value at
        their mean. [s^2]
    out : tuple of three ndarrays, shape (n,), optional
        Where to put the answer.

    Returns
    -------
    x, d_tau, d_theta : ndarray, shape (n,)
        The answer as a deviation from the level before the first move [OP], and its derivatives
        with respect to tau and theta [OP/s].
    """
    x, d_tau, d_theta = out or (np.empty(t.size), np.empty(t.size), np.empty(t.size))
    widened = None
    if spread is not None:
        widened = spread * (0.5 / (tau * tau))
        widened += 1.0
    if held.moves == 1:  # the commonest by far
        arrival, jump = float(held.instants[0]) + theta, float(held.levels[1] - held.levels[0])
        cut = int(t.searchsorted(arrival))
        x[:cut] = d_tau[:cut] = d_theta[:cut] = 0.0
        if cut < t.size:
            more = None if widened is None else widened[cut:]
            part = (x[cut:], d_tau[cut:], d_theta[cut:])
            _decay(t[cut:], arrival, tau, (-jump, 0.0, jump), more, part)
        return x, d_tau, d_theta
    z, dz = states or lag_states(held, tau)
    levels = held.levels - held.levels[0]
    arrivals = held.instants + theta
    # The moves that each sample can follow, from the first to the last.
    first = int(arrivals.searchsorted(t[0], side="right"))
    last = int(arrivals.searchsorted(t[-1], side="right"))
    edges = [0, *t.searchsorted(arrivals[first:last]).tolist(), t.size]
    if last - first < FEW:
        for k, (a, b) in enumerate(pairwise(edges), start=first):
            part = (x[a:b], d_tau[a:b], d_theta[a:b])
            if a == b:
                continue
            if k == 0:  # nothing has arrived yet
                for values in part:
                    values.fill(0.0)
            else:
                state = (float(z[k]), float(dz[k]), float(levels[k]))
                more = None if widened is None else widened[a:b]
                _decay(t[a:b], float(arrivals[k - 1]), tau, state, more, part)
    else:
        behind = np.repeat(np.arange(first, last + 1), np.diff(edges))
        origin = arrivals[np.maximum(behind - 1, 0)]
        _decay(
            t, origin, tau, (z[behind], dz[behind], levels[behind]), widened, (x, d_tau, d_theta)
        )
    return x, d_tau, d_theta


def _decay(
    t: Real,
    origin: Real | float,
    tau: float,
    state: tuple[Real | float, Real | float, Real | float],
    widened: Real | None,
    out: tuple[Real, Real, Real],
) -> None:
    """Exponentials from distance, its derivative and the level aimed at, at their origins."""
    x, d_tau, d_theta = out
    z, dz, level = state
    rate = 1 / tau
    np.subtract(origin, t, out=x)
    x *= rate
    if isinstance(origin, np.ndarray) or x[-1] < -LONGEST:
        # Where nothing has arrived yet z is 0, whatever the age.
        np.clip(x, -LONGEST, 0.0, out=x)
    np.exp(x, out=d_theta)
    if widened is not None:
        d_theta *= widened
    if isinstance(dz, np.ndarray) or dz != 0:
        np.multiply(d_theta, dz, out=d_tau)
        d_theta *= z * rate
        d_tau -= x * d_theta
    else:
        d_theta *= z * rate
        np.multiply(x, d_theta, out=d_tau)
        np.negative(d_tau, out=d_tau)
    np.multiply(d_theta, tau, out=x)
    x += level
