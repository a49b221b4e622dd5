"""Frequency response of a loop with exact dead time: L, S, T and the sensitivities to plot."""

import math

import numpy as np

from loop.controller import PID, controller_response
from loop.crossovers import crossovers, gain_cuts
from loop.factors import FactoredLoop
from loop.process import Process
from loop.signals import Complex, Real

# A plot shows this factor beyond what matters on either side.
FRAME = 10.0
# Corners further than this from the crossovers do not belong in the same picture.
NEARBY = 300.0
LOWEST, HIGHEST = 1e-60, 1e60


def loop_response(process: Process, controller: PID, w: Real) -> Complex:
    """Evaluate L(jw) = G(jw) C(jw), dead time exact.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    w : ndarray
        Frequencies. [rad/s]

    Raises
    ------
    ValueError
        A frequency lies outside 1e-60 to 1e60 rad/s.
    """
    return _over(process, controller, w)[0]


def loop_phase(process: Process, controller: PID, w: Real) -> Real:
    """Evaluate the phase of L(jw) without jumps of 360°, for a Bode plot. [°]

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    w : ndarray
        Frequencies. [rad/s]

    Raises
    ------
    ValueError
        A frequency lies outside 1e-60 to 1e60 rad/s.
    """
    return np.degrees(FactoredLoop.of(process, controller).phase(_flat(w))).reshape(np.shape(w))


def sensitivity(process: Process, controller: PID, w: Real) -> Complex:
    """Evaluate S = 1/(1 + L): from a load at the process output to the control error. [-]

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    w : ndarray
        Frequencies. [rad/s]

    Raises
    ------
    ValueError
        A frequency lies outside 1e-60 to 1e60 rad/s.
    """
    return _over(process, controller, w)[1]


def complementary_sensitivity(process: Process, controller: PID, w: Real) -> Complex:
    """Evaluate T = L/(1 + L): from measurement noise to PV, turned in sign. [-]

    With b = c = 1 it is also the response of PV to the set point.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    w : ndarray
        Frequencies. [rad/s]

    Raises
    ------
    ValueError
        A frequency lies outside 1e-60 to 1e60 rad/s.
    """
    L, S = _over(process, controller, w)
    return np.asarray(L * S)


def load_sensitivity(process: Process, controller: PID, w: Real) -> Complex:
    """Evaluate G S = G/(1 + L): from a load at the process input to PV. [PV/OP]

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    w : ndarray
        Frequencies. [rad/s]

    Raises
    ------
    ValueError
        A frequency lies outside 1e-60 to 1e60 rad/s.
    """
    L, S = _over(process, controller, w)
    # T/C rather than G S: finite even where G has a pole on the axis.
    return np.asarray(L * S / controller_response(controller, 1j * np.asarray(w)))


def control_sensitivity(process: Process, controller: PID, w: Real) -> Complex:
    """Evaluate C S = C/(1 + L): from measurement noise to OP, turned in sign. [OP/PV]

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    w : ndarray
        Frequencies. [rad/s]

    Raises
    ------
    ValueError
        A frequency lies outside 1e-60 to 1e60 rad/s.
    """
    S = _over(process, controller, w)[1]
    return np.asarray(S * controller_response(controller, 1j * np.asarray(w)))


def frequency_grid(process: Process, controller: PID, points: int = 400) -> Real:
    """Choose frequencies that show the crossovers and the corners near them.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings; the loop need not be stable.
    points : int
        Number of logarithmically spaced frequencies.

    Returns
    -------
    ndarray, shape (points + m,)
        Ascending frequencies, the m crossovers among them exactly. [rad/s]

    Raises
    ------
    ValueError
        There are fewer than 2 points.
    """
    if points < 2:
        raise ValueError(f"a plot needs at least 2 points, got {points}")
    loop = FactoredLoop.of(process, controller)
    found = crossovers(loop, gain_cuts(loop))
    w180 = np.array([run.w180 for run in found.runs if not math.isnan(run.w180)])
    roots = np.abs(np.concatenate([loop.zeros, loop.poles]))
    corners = roots[roots > 0]
    if loop.theta > 0:
        corners = np.append(corners, 1 / loop.theta)
    main = np.concatenate([found.wc, w180]) if found.wc.size else w180
    if not main.size:
        main = corners if corners.size else np.array([1.0])
    near = corners[(corners > main.min() / NEARBY) & (corners < main.max() * NEARBY)]
    shown = np.concatenate([main, near])
    even = np.geomspace(shown.min() / FRAME, shown.max() * FRAME, points)
    return np.union1d(even, main)


def _flat(w: Real) -> Real:
    given = np.asarray(w, dtype=float)
    if not np.all((given >= LOWEST) & (given <= HIGHEST)):
        raise ValueError(f"frequencies must lie within {LOWEST:g} and {HIGHEST:g} rad/s")
    return given.ravel()


def _over(process: Process, controller: PID, w: Real) -> tuple[Complex, Complex]:
    """L and S = 1/(1 + L) in the shape of w."""
    L = FactoredLoop.of(process, controller).response(_flat(w)).reshape(np.shape(w))
    distance = 1 + L
    # On the stability limit L is -1; one rounding error beside it keeps the answer finite.
    return L, np.asarray(1 / np.where(distance == 0, np.finfo(float).eps, distance))
