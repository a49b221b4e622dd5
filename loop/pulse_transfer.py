"""A sampled process as a difference equation, for signals that were recorded at every scan."""

from dataclasses import dataclass

import numpy as np

from loop.errors import PoorExcitation
from loop.process import Process
from loop.sampled_process import sampled
from loop.sampled_response import held_response
from loop.signals import Complex, Real

# The polynomials must give the frequency response that the state space gives, to this part.
SAME_RESPONSE = 1e-4
# Two states keep theirs down to a ten-millionth of the lags.
SAFE_ORDER = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PulseTransfer:
    """y[k] + a1 y[k-1] + ... = b0 u[k-q] + b1 u[k-q-1] + ..., the input held over every scan.

    Attributes
    ----------
    a : ndarray, shape (n + 1,)
        Coefficients of y, the first 1. [-]
    b : ndarray, shape (n + 2,)
        Coefficients of u. [PV/OP]
    q : int
        Whole scans of dead time.
    """

    a: Real
    b: Real
    q: int

    def numerator(self, z: Complex) -> Complex:
        """B(z) z^-q. [PV/OP]"""
        return np.asarray(np.polyval(self.b[::-1], 1 / z) * z ** -float(self.q))

    def denominator(self, z: Complex) -> Complex:
        """A(z). [-]"""
        return np.asarray(np.polyval(self.a[::-1], 1 / z))

    def delayed(self, op: Real) -> Real:
        """Shift an output by the whole scans of dead time; it held op[0] before.

        Parameters
        ----------
        op : ndarray, shape (n,)
            Controller output at every scan. [OP]
        """
        if not self.q:
            return op
        held = np.full(min(self.q, op.size), op[0])
        return np.concatenate([held, op[: op.size - held.size]])


def pulse_transfer(process: Process, dt: float) -> PulseTransfer:
    """Write a sampled process as a difference equation, fractional dead time included.

    C (zI - Phi)^-1 g = (det(zI - Phi + g C) - det(zI - Phi)) / det(zI - Phi)

    Parameters
    ----------
    process : Process
        Process model.
    dt : float
        Scan time. [s]

    Raises
    ------
    PoorExcitation
        The process is of so high an order, or so slow for the scan time, that its polynomials lose
        their digits.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> transfer = pulse_transfer(FOPDT(K=2.0, tau=10.0, theta=3.0), dt=1.0)
    >>> transfer.q, transfer.a.round(4).tolist(), transfer.b.round(4).tolist()
    (3, [1.0, -0.9048], [0.0, 0.1903, 0.0])
    """
    plant = sampled([process], dt)
    Phi, C, D = plant.Phi[0], plant.C[0], float(plant.D[0])
    a = np.atleast_1d(np.poly(Phi)).real
    early, late = (
        np.atleast_1d(np.poly(Phi - np.outer(g, C))).real - a
        for g in (plant.early[0], plant.late[0])
    )
    b = np.append(early, 0.0)
    b[1:] += late + D * a
    if len(process.denominator) == 1:
        # A pure gain keeps a state that never moves; it must not stay as a common factor.
        a, b = np.ones(1), np.array([0.0, D])
    found = PulseTransfer(a=a, b=b, q=int(plant.q[0]))
    if a.size <= SAFE_ORDER + 1:
        return found
    z = np.exp(1j * np.geomspace(1e-2, 3.0, 9))
    P = held_response(process, z, dt=dt)
    if not np.allclose(found.numerator(z) / found.denominator(z), P, rtol=SAME_RESPONSE, atol=0):
        raise PoorExcitation(
            f"a sample time of {dt:g} s is too fine for a model of so high an order"
        )
    return found
