"""Smith predictor on first order plus dead time, with a sweep of its own."""

import math
from dataclasses import dataclass

import numpy as np

from loop.controller import PID, Action, controller_response
from loop.errors import RuleNotApplicable
from loop.margins import Margins
from loop.process import FOPDT
from loop.response_margins import ResponseLoop, following_grid, response_margins
from loop.signals import Complex
from tuning.response_sweep import ResponseSweep, sweep_response
from tuning.sweep import FACTORS

# Beyond this multiple of the corners |L| is below a hundredth.
BEYOND = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SmithPredictor:
    """A PI controller with the model of the process inside, C/(1 + C G0 (1 - e^(-theta s))).

    Attributes
    ----------
    pid : PID
        Primary controller, tuned on the model without its dead time.
    model : FOPDT
        Model that runs inside; `theta` is the dead time to program.
    tau_c : float
        Closed-loop time constant after the dead time, at the model. [s]
    """

    pid: PID
    model: FOPDT
    tau_c: float

    @property
    def load_area(self) -> float:
        """Area of PV after a unit load step, K (tau_c + theta): that of a lambda PI. [PV s/OP]"""
        return abs(self.model.K) * (self.tau_c + self.model.theta)


def smith_predictor(model: FOPDT, tau_c: float) -> SmithPredictor:
    """Tune a Smith predictor for a closed loop of first order after the dead time [1]_.

    C(s) = tau/(K tau_c) (1 + 1/(tau s)); at the model PV follows the set point as
    e^(-theta s)/(tau_c s + 1).

    Parameters
    ----------
    model : FOPDT
        Process model with dead time.
    tau_c : float
        Closed-loop time constant after the dead time. [s]

    Raises
    ------
    RuleNotApplicable
        The model has no dead time to predict over.
    ValueError
        tau_c is not positive.

    References
    ----------
    .. [1] O. J. M. Smith, "Closer control of loops with dead time", Chemical Engineering Progress
       53 (1957) 217-219 (from memory).
    """
    if not model.theta:
        raise RuleNotApplicable("A Smith predictor", "there is no dead time to predict over")
    if not (tau_c > 0 and math.isfinite(tau_c)):
        raise ValueError(f"tau_c must be positive, got {tau_c}")
    pid = PID(Kc=model.tau / (abs(model.K) * tau_c), Ti=model.tau, action=Action.for_gain(model.K))
    return SmithPredictor(pid=pid, model=model, tau_c=tau_c)


def smith_margins(predictor: SmithPredictor, process: FOPDT) -> Margins:
    """Find the margins of a Smith predictor on a process that need not be its model.

    The loop is opened at the process input: L = C G / (1 + C G0 (1 - e^(-theta0 s))), with G the
    process and G0 the model without its dead time. Both dead times are exact.

    Parameters
    ----------
    predictor : SmithPredictor
        Predictor with its model.
    process : FOPDT
        Process as it is.

    Raises
    ------
    UnstableLoop
        The closed loop is unstable.
    """
    model = predictor.model

    def parts(s: Complex) -> tuple[Complex, Complex]:
        """C G, and the loop inside the predictor."""
        C = controller_response(predictor.pid, s)
        inner = C * model.K / (model.tau * s + 1) * -np.expm1(-model.theta * s)
        outer = C * process.K / (process.tau * s + 1) * np.exp(-process.theta * s)
        return np.asarray(outer), np.asarray(inner)

    def opened(s: Complex) -> Complex:
        outer, inner = parts(s)
        return np.asarray(outer / (1 + inner))

    # The loop inside, tau_c s + 1 - e^(-theta s), has no zero right of the axis but the origin.
    # |C G0| = 1/(tau_c w) at the model: far above its corner both parts are small.
    gain = abs(process.K / model.K) * max(1.0, model.tau / process.tau)
    top = BEYOND * max(1.0, gain) / predictor.tau_c
    corners = [1 / predictor.tau_c, 1 / model.tau, 1 / process.tau, 1 / model.theta]
    w = following_grid(corners, top, model.theta + process.theta)
    return response_margins(ResponseLoop(L=opened, w=w))


def sweep_smith(
    predictor: SmithPredictor, *, factors: tuple[float, ...] = FACTORS
) -> ResponseSweep:
    """Move one parameter of the process at a time while the model stays.

    Parameters
    ----------
    predictor : SmithPredictor
        Predictor with its model.
    factors : tuple of float
        Factors on the parameter; 0.5 to 1.5 in eleven steps if not given. [-]
    """
    model = predictor.model
    return sweep_response(
        lambda parameters: smith_margins(predictor, FOPDT(**parameters)),
        {"K": model.K, "tau": model.tau, "theta": model.theta},
        factors=factors,
    )
