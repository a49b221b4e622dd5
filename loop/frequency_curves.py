"""The curves of a loop for Bode, Nyquist and Nichols plots, with exact dead time."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from loop.bracket_solver import solve_brackets
from loop.compensators import Compensator, compensator_response, in_series
from loop.controller import PID, controller_response
from loop.crossovers import gain_cuts
from loop.factors import FactoredLoop
from loop.process import Process
from loop.response import frequency_grid, loop_phase, loop_response, sensitivity
from loop.signals import Complex, Real

THREE_DB = 1 / math.sqrt(2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrequencyCurves:
    """L and the four closed-loop responses over frequency; every array of shape (n,).

    Attributes
    ----------
    w : ndarray
        Frequencies, ascending, the crossovers among them. [rad/s]
    L : ndarray of complex
        Open loop; its real and imaginary part make the Nyquist plot. [-]
    phase : ndarray
        Phase of L without jumps; with 20 log10 |L| over it, the Nichols plot. [°]
    S, T : ndarray of complex
        1/(1 + L) and L/(1 + L). [-]
    GS : ndarray of complex
        From a load at the process input to PV. [PV/OP]
    CS : ndarray of complex
        From measurement noise to OP, turned in sign. [OP/PV]
    """

    w: Real
    L: Complex
    phase: Real
    S: Complex
    T: Complex
    GS: Complex
    CS: Complex


def frequency_curves(
    process: Process,
    controller: PID,
    *,
    compensators: Sequence[Compensator] = (),
    points: int = 400,
    w: Real | None = None,
) -> FrequencyCurves:
    """Evaluate the open and the closed loop over frequency.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings; the loop need not be stable.
    compensators : sequence of Compensator
        Compensators in series with the controller.
    points : int
        Number of frequencies chosen where `w` is not given.
    w : ndarray, shape (n,), optional
        Frequencies; around the crossovers if not given. [rad/s]

    Raises
    ------
    ValueError
        There are fewer than 2 points, or a frequency is outside 1e-60 to 1e60 rad/s.
    """
    whole = in_series(process, compensators)
    w = frequency_grid(whole, controller, points) if w is None else np.asarray(w, dtype=float)
    L, S = loop_response(whole, controller, w), sensitivity(whole, controller, w)
    T = np.asarray(L * S)
    C = controller_response(controller, 1j * w) * compensator_response(compensators, 1j * w)
    return FrequencyCurves(
        w=w,
        L=L,
        phase=loop_phase(whole, controller, w),
        S=S,
        T=T,
        GS=np.asarray(T / C),
        CS=np.asarray(S * C),
    )


def sensitivity_circle(Ms: float, points: int = 181) -> Complex:
    """Points L of the Nyquist plot at which |S| = Ms: the circle of radius 1/Ms about -1.

    Parameters
    ----------
    Ms : float
        Peak of |S|. [-]
    points : int
        Number of points, the first repeated at the end.
    """
    if not (Ms > 0 and math.isfinite(Ms)):
        raise ValueError(f"Ms must be positive, got {Ms}")
    return np.asarray(-1 + np.exp(1j * np.linspace(0, 2 * math.pi, points)) / Ms)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bandwidths:
    """How far up in frequency the loop works; None where a curve never gets there.

    Attributes
    ----------
    S : float or None
        Frequency at which |S| first rises to 1/sqrt(2): loads below are reduced. [rad/s]
    T : float or None
        Frequency at which |T| last falls to 1/sqrt(2): the set point is followed below. [rad/s]
    wc : float or None
        Highest gain crossover. [rad/s]
    """

    S: float | None
    T: float | None
    wc: float | None


def bandwidths(process: Process, controller: PID) -> Bandwidths:
    """Find the bandwidths of a loop.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    """
    loop = FactoredLoop.of(process, controller)
    cuts = gain_cuts(loop)
    w = cuts.w
    if loop.theta > 0:
        # S and T ripple with the dead time while |L| is not small.
        top = 4 * max(float(cuts.wc[-1]) if cuts.wc.size else 0.0, 1 / loop.theta)
        step = math.pi / (16 * loop.theta)
        w = np.union1d(w, np.arange(step, min(top, 4000 * step), step))

    def rise_of_s(v: Real) -> Real:
        return np.asarray(np.abs(1 / (1 + loop.response(v))) - THREE_DB)

    def rise_of_t(v: Real) -> Real:
        L = loop.response(v)
        return np.asarray(np.abs(L / (1 + L)) - THREE_DB)

    S, T = rise_of_s(w), rise_of_t(w)
    rises = np.flatnonzero((S[:-1] < 0) & (S[1:] >= 0))
    falls = np.flatnonzero((T[:-1] > 0) & (T[1:] <= 0))
    return Bandwidths(
        S=_root(rise_of_s, w, rises[:1]),
        T=_root(rise_of_t, w, falls[-1:]),
        wc=float(cuts.wc[-1]) if cuts.wc.size else None,
    )


def _root(f: Callable[[Real], Real], w: Real, at: npt.NDArray[np.intp]) -> float | None:
    return float(solve_brackets(f, w[at], w[at + 1])[0]) if at.size else None
