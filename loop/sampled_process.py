"""Exact motion of a process between samples while its input is held.

A held input makes the motion of a linear process between two samples exact: no integration step,
no Padé approximation. Dead time only shifts the instant at which the input changes; a change that
falls between two samples splits the interval there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from loop.batch import ProcessBatch
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, PureDelay, TransferFunction
from loop.signals import Real

# A dead time this close to a whole number of scans, in scans, is that number: 3 x 0.1 s is 0.3 s.
WHOLE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StateSpace:
    """Rational part of a process, dx/dt = A x + B u, y = C x + D u.

    Attributes
    ----------
    A : ndarray, shape (n, n)
        Dynamics. [1/s]
    B, C : ndarray, shape (n,)
        Input and output vectors.
    D : float
        Direct feedthrough, 0 unless numerator and denominator have the same degree. [PV/OP]
    """

    A: Real
    B: Real
    C: Real
    D: float


def state_space(process: Process) -> StateSpace:
    """Realise the rational part of a process; a pure gain keeps one state that never moves.

    Parameters
    ----------
    process : Process
        Process model; its dead time is left out.
    """
    match process:
        case FOPDT(K=K, tau=tau):
            return _space([[-1 / tau]], [1 / tau], [K])
        case SOPDT(K=K, tau1=tau1, tau2=tau2):
            # A cascade is triangular, which keeps the exponential accurate for tau2 << tau1.
            A = [[-1 / tau1, 1 / tau1], [0.0, -1 / tau2]]
            return _space(A, [0.0, 1 / tau2], [K, 0.0])
        case IPDT(K=K):
            return _space([[0.0]], [1.0], [K])
        case DoubleIntegrator(K=K):
            return _space([[0.0, 1.0], [0.0, 0.0]], [0.0, 1.0], [K, 0.0])
        case _:
            return _companion(process)


def _space(
    A: Sequence[Sequence[float]], B: Sequence[float], C: Sequence[float], D: float = 0.0
) -> StateSpace:
    return StateSpace(A=np.array(A), B=np.array(B), C=np.array(C), D=D)


def _companion(process: PureDelay | TransferFunction) -> StateSpace:
    """Controllable companion form in a time unit in which the poles are of size one."""
    d = np.array(process.denominator)
    order = d.size - 1
    if order == 0:
        return _space([[0.0]], [0.0], [0.0], process.numerator[0] / d[0])
    n = np.concatenate([np.zeros(d.size - len(process.numerator)), process.numerator]) / d[0]
    d = d / d[0]
    sizes = [abs(d[i]) ** (1 / i) for i in range(1, order + 1) if d[i]]
    rate = max(sizes, default=1.0)
    powers = rate ** np.arange(order + 1)
    d, n = d / powers, n / powers
    A = np.eye(order, k=-1)
    A[0] = -d[1:]
    B = np.zeros(order)
    B[0] = rate
    return StateSpace(A=rate * A, B=B, C=n[1:] - n[0] * d[1:], D=float(n[0]))


def motion(A: Real, B: Real, dt: Real) -> tuple[Real, Real]:
    """Give Phi and Gamma of x(t + dt) = Phi x(t) + Gamma u for an input held over dt.

    [Phi Gamma; 0 1] = exp([A B; 0 0] dt)

    Parameters
    ----------
    A : ndarray, shape (m, n, n) or (1, n, n)
        Dynamics. [1/s]
    B : ndarray, shape (m, n) or (1, n)
        Input vectors.
    dt : ndarray, shape (m,)
        Length of every interval. [s]

    Returns
    -------
    Phi : ndarray, shape (m, n, n)
    Gamma : ndarray, shape (m, n)
    """
    n = A.shape[-1]
    if n == 1:
        p = A[:, 0, 0]
        z = p * dt
        safe = np.where(p == 0, 1.0, p)
        held = np.where(p == 0, dt, np.expm1(z) / safe)
        return np.exp(z)[:, None, None], B * held[:, None]
    augmented = np.zeros((dt.size, n + 1, n + 1))
    augmented[:, :n, :n] = A * dt[:, None, None]
    augmented[:, :n, n] = B * dt[:, None]
    moved = expm(augmented)
    return moved[:, :n, :n], moved[:, :n, n]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledProcesses:
    """Processes between scans: x[k+1] = Phi x[k] + late u[k-q-1] + early u[k-q].

    The output is y[k] = C x[k] + D u[k-q-1], read just before the input moves.

    Attributes
    ----------
    Phi : ndarray, shape (m, n, n)
        Motion over one scan.
    late, early : ndarray, shape (m, n)
        Weight of the input that holds before and after the change within the scan.
    C : ndarray, shape (m, n)
        Output vectors.
    D : ndarray, shape (m,)
        Direct feedthrough. [PV/OP]
    q : ndarray of int, shape (m,)
        Whole scans of dead time.
    """

    Phi: Real
    late: Real
    early: Real
    C: Real
    D: Real
    q: npt.NDArray[np.int64]

    def take(self, rows: npt.NDArray[np.intp]) -> Self:
        """Pick processes by index.

        Parameters
        ----------
        rows : ndarray of int
            Indices; one may repeat.
        """
        return type(self)(**{item.name: getattr(self, item.name)[rows] for item in fields(self)})


def sampled(processes: Sequence[Process] | ProcessBatch, dt: float) -> SampledProcesses:
    """Discretise processes exactly for an input held over a scan, fractional dead time included.

    Parameters
    ----------
    processes : sequence of Process, length m, or ProcessBatch of m processes
        Process models; lower orders are filled up with states that never move.
    dt : float
        Scan time. [s]
    """
    if isinstance(processes, ProcessBatch):
        A, B, C, D, theta = _chains(processes)
    else:
        A, B, C, D, theta = _filled_up(processes)
    scans = theta / dt
    whole = np.floor(scans + WHOLE)
    first = np.clip(scans - whole, 0.0, 1.0) * dt
    Phi_first, Gamma_first = motion(A, B, first)
    Phi_rest, early = motion(A, B, dt - first)
    return SampledProcesses(
        Phi=Phi_rest @ Phi_first,
        late=np.einsum("mij,mj->mi", Phi_rest, Gamma_first),
        early=early,
        C=C,
        D=D,
        q=whole.astype(np.int64),
    )


def _filled_up(processes: Sequence[Process]) -> tuple[Real, Real, Real, Real, Real]:
    """A, B, C, D and theta of m processes, all of the highest order among them."""
    spaces = [state_space(process) for process in processes]
    order = max(space.B.size for space in spaces)
    A = np.zeros((len(spaces), order, order))
    B, C = np.zeros((len(spaces), order)), np.zeros((len(spaces), order))
    for i, space in enumerate(spaces):
        n = space.B.size
        A[i, :n, :n], B[i, :n], C[i, :n] = space.A, space.B, space.C
    D = np.array([space.D for space in spaces])
    return A, B, C, D, np.array([process.theta for process in processes])


def _chains(batch: ProcessBatch) -> tuple[Real, Real, Real, Real, Real]:
    """A, B, C, D and theta of lags and integrators in a row, the one next to PV first.

    A lag is dx/dt = (input - x)/tau, an integrator dx/dt = input. Loops with fewer of them keep
    their unused states at rest.
    """
    K, tau1, tau2, integrators, theta = (
        np.broadcast_to(values, batch.shape).ravel()
        for values in (batch.K, batch.tau1, batch.tau2, batch.integrators, batch.theta)
    )
    used = np.stack([tau1 > 0, tau2 > 0, integrators > 0, integrators > 1], axis=1)
    ones = np.ones(K.size)
    speeds = 1 / np.where(used, np.stack([tau1, tau2, ones, ones], axis=1), 1.0)
    returns = np.where([True, True, False, False], -speeds, 0.0)
    order = max(int(used.sum(axis=1).max()), 1)
    A: Real = np.zeros((K.size, order, order))
    B: Real = np.zeros((K.size, order))
    C: Real = np.zeros((K.size, order))
    place, loops = np.zeros(K.size, dtype=np.int64), np.arange(K.size)
    for kind in range(4):
        i = loops[used[:, kind]]
        at, speed = place[i], speeds[i, kind]
        A[i, at, at] = returns[i, kind]
        last = at + 1 == used[i].sum(axis=1)
        A[i[~last], at[~last], at[~last] + 1] = speed[~last]
        B[i[last], at[last]] = speed[last]
        place[i] += 1
    C[:, 0] = np.where(place > 0, K, 0.0)
    D: Real = np.where(place > 0, 0.0, K)
    return A, B, C, D, theta.astype(np.float64)


def scans_in(t_end: float, dt: float) -> int:
    """Count the scans at 0, dt, 2 dt ... up to t_end, both ends included."""
    return math.floor(t_end / dt + WHOLE) + 1
