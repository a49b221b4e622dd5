"""Smith predictor on first order plus dead time, with a sweep of its own."""

import math
from dataclasses import dataclass

import numpy as np

from loop.controller import PID, Action, controller_response
from loop.errors import RuleNotApplicable, UnstableLoop
from loop.margins import Margins
from loop.process import FOPDT
from loop.response_margins import ResponseLoop, following_grid, response_margins
from loop.signals import Complex

FACTORS = tuple(0.5 + 0.1 * i for i in range(11))
UNSTABLE = Margins(gain=0.0, gain_reduction=0.0, phase=0.0, delay=0.0, Ms=math.inf, Mt=math.inf)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SmithSweep:
    """What a Smith predictor keeps when its model is wrong.

    Attributes
    ----------
    nominal : Margins
        At the model.
    factors : tuple of float
        Factors on one parameter of the process at a time. [-]
    swept : dict of tuple of Margins
        By parameter K, tau, theta, at every factor; an unstable loop has margins 0 and Ms
        infinite.
    worst_Ms : float
        Largest Ms of all. [-]
    worst : str
        Where that is.
    """

    nominal: Margins
    factors: tuple[float, ...]
    swept: dict[str, tuple[Margins, ...]]
    worst_Ms: float
    worst: str


def sweep_smith(predictor: SmithPredictor) -> SmithSweep:
    """Move one parameter of the process at a time by ±50 % while the model stays.

    Parameters
    ----------
    predictor : SmithPredictor
        Predictor with its model.
    """
    model = predictor.model
    swept = {
        name: tuple(_swept(predictor, model, name, factor) for factor in FACTORS)
        for name in ("K", "tau", "theta")
    }
    worst_Ms, worst = max(
        (found.Ms, f"{name} x {factor:.2g}")
        for name, row in swept.items()
        for factor, found in zip(FACTORS, row, strict=True)
    )
    return SmithSweep(
        nominal=smith_margins(predictor, model),
        factors=FACTORS,
        swept=swept,
        worst_Ms=worst_Ms,
        worst=worst,
    )


def _swept(predictor: SmithPredictor, model: FOPDT, name: str, factor: float) -> Margins:
    moved = {"K": model.K, "tau": model.tau, "theta": model.theta}
    moved[name] *= factor
    try:
        return smith_margins(predictor, FOPDT(**moved))
    except UnstableLoop:
        return UNSTABLE
