"""Margins of many loops at once, with exact dead time."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID, Action
from loop.errors import UnstableLoop
from loop.margins import Margins, margins
from loop.process import TransferFunction
from loop.signals import Flags, Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MarginBatch:
    """Margins of a batch of loops, each array of the batch's shape.

    Where a loop is unstable, `stable` is False, `gain`, `gain_reduction`, `phase` and `delay` are
    0 and `Ms` and `Mt` infinite.

    Attributes
    ----------
    stable : ndarray of bool
        Whether the closed loop is stable.
    gain, gain_reduction : ndarray of float
        Gain margin, and the factor on the gain below which stability is lost. [-]
    phase : ndarray of float
        Phase margin. [°]
    delay : ndarray of float
        Delay margin. [s]
    Ms, Mt : ndarray of float
        Peaks of |1/(1 + L)| and |L/(1 + L)|. [-]
    """

    stable: Flags
    gain: Real
    gain_reduction: Real
    phase: Real
    delay: Real
    Ms: Real
    Mt: Real


UNSTABLE = Margins(gain=0.0, gain_reduction=0.0, phase=0.0, delay=0.0, Ms=math.inf, Mt=math.inf)


def batch_margins(
    processes: ProcessBatch, controllers: PIDBatch, *, sample_time: npt.ArrayLike = 0.0
) -> MarginBatch:
    """Find the margins of every loop of a batch, as `loop.margins.margins` does for one.

    Parameters
    ----------
    processes : ProcessBatch
        Process models.
    controllers : PIDBatch
        Controllers; the shapes of both broadcast.
    sample_time : array_like
        Scan time h of the controllers; the hold adds h/2 of dead time. [s]

    Raises
    ------
    ValueError
        A sample time is negative or not finite.
    """
    parts = np.broadcast_arrays(
        processes.K,
        processes.tau1,
        processes.tau2,
        processes.integrators,
        processes.theta,
        controllers.Kc,
        controllers.Ti,
        controllers.Td,
        controllers.N,
        controllers.tauF,
        controllers.sign,
        np.asarray(sample_time, dtype=float),
    )
    found = [_one([float(x) for x in row]) for row in zip(*(p.ravel() for p in parts), strict=True)]
    shape = parts[0].shape

    def gather(name: str) -> Real:
        return np.array([getattr(m, name) for m in found]).reshape(shape)

    return MarginBatch(
        stable=np.isfinite(gather("Ms")),
        gain=gather("gain"),
        gain_reduction=gather("gain_reduction"),
        phase=gather("phase"),
        delay=gather("delay"),
        Ms=gather("Ms"),
        Mt=gather("Mt"),
    )


def _one(row: list[float]) -> Margins:
    K, tau1, tau2, integrators, theta, Kc, Ti, Td, N, tauF, sign, sample_time = row
    lags = (tau1 * tau2, tau1 + tau2, 1.0)
    process = TransferFunction((K,), lags + (0.0,) * int(integrators), theta)
    action = Action.REVERSE if sign > 0 else Action.DIRECT
    controller = PID(Kc=Kc, Ti=Ti, Td=Td, N=N, tauF=tauF, action=action)
    try:
        return margins(process, controller, sample_time=sample_time)
    except UnstableLoop:
        return UNSTABLE
