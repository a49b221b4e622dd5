"""Lambda tuning of PI controllers.

Source: E. B. Dahlin, "Designing and tuning digital controllers," Instrum. Control Syst.,
vol. 41, no. 6, pp. 77-83, 1968, and direct synthesis. The original was not read; one public source
quotes the formula, and it follows from asking for L(s) = e^(-theta s)/((tau_c + theta) s), whose
margins are GM = (pi/2)(tau_c + theta)/theta and PM = 90° - 57.3° theta/(tau_c + theta).

The integrating form is from memory (lambda tuning of level loops) and not confirmed.

Not to be confused with `imc_pi`, tau/(K tau_c).
"""

from types import MappingProxyType

from loop.controller import PID, Action
from loop.process import FOPDT, IPDT, Process
from tuning.rule import Rule, accept, chosen_tau_c, no_notes

TITLE = "Lambda PI"
INTEGRATING_TITLE = "Lambda PI (integrating)"


def default_tau_c(process: Process) -> float:
    """Take tau_c no faster than the open loop and no faster than 3 dead times.

    tau_c = max(tau, 3 theta): the slower of the two keeps the loop within the default profile for
    ±50 % of model error. [s]
    """
    model = accept(process, FOPDT, TITLE)
    return max(model.tau, 3 * model.theta)


def default_tau_c_integrating(process: Process) -> float:
    """Take tau_c = 3 theta: an integrator has no time constant of its own. [s]"""
    return 3 * accept(process, IPDT, INTEGRATING_TITLE).theta


def lambda_pi(process: Process, tau_c: float | None = None) -> PID:
    """Tune a PI controller: Kc = tau/(K (tau_c + theta)), Ti = tau.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant (lambda). Default: max(tau, 3 theta). [s]

    Raises
    ------
    RuleNotApplicable
        The process has another type.

    Examples
    --------
    >>> pid = lambda_pi(FOPDT(K=100.0, tau=0.05, theta=0.005), tau_c=0.0125)
    >>> round(pid.Kc, 5), pid.Ti
    (0.02857, 0.05)
    """
    model = accept(process, FOPDT, TITLE)
    speed = chosen_tau_c(tau_c, default_tau_c(model), TITLE)
    return PID(
        Kc=model.tau / (abs(model.K) * (speed + model.theta)),
        Ti=model.tau,
        action=Action.for_gain(model.K),
    )


def lambda_integrating_pi(process: Process, tau_c: float | None = None) -> PID:
    """Tune a PI controller for an integrator (from memory).

    Kc = (2 tau_c + theta)/(K (tau_c + theta)^2), Ti = 2 tau_c + theta.

    Parameters
    ----------
    process : IPDT
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant (lambda). Default: 3 theta. [s]

    Raises
    ------
    RuleNotApplicable
        There is neither a dead time nor a tau_c, or the process has another type.

    Examples
    --------
    >>> pid = lambda_integrating_pi(IPDT(K=0.5, theta=1.0), tau_c=3.0)
    >>> pid.Kc, pid.Ti
    (0.875, 7.0)
    """
    model = accept(process, IPDT, INTEGRATING_TITLE)
    speed = chosen_tau_c(tau_c, default_tau_c_integrating(model), INTEGRATING_TITLE)
    Ti = 2 * speed + model.theta
    return PID(
        Kc=Ti / (abs(model.K) * (speed + model.theta) ** 2),
        Ti=Ti,
        action=Action.for_gain(model.K),
    )


_AIM = "the closed-loop response of a first-order lag with time constant tau_c"
RULE = Rule(
    name="lambda_pi",
    title=TITLE,
    source="Dahlin 1968, Instrum. Control Syst. 41 (6), 77-83; direct synthesis",
    status="confirmed",
    aim=_AIM,
    form="ISA",
    validity="any FOPDT; a slow load disturbance recovers with tau, however small tau_c",
    structures=MappingProxyType({"PI": lambda_pi}),
    takes=MappingProxyType({"PI": ("FOPDT",)}),
    notes=no_notes,
    tau_c_text="max(tau, 3 theta)",
    default_tau_c=default_tau_c,
)
INTEGRATING_RULE = Rule(
    name="lambda_integrating_pi",
    title=INTEGRATING_TITLE,
    source="lambda tuning of level loops, from memory",
    status="memory",
    aim=_AIM,
    form="ISA",
    validity="not known",
    structures=MappingProxyType({"PI": lambda_integrating_pi}),
    takes=MappingProxyType({"PI": ("IPDT",)}),
    notes=no_notes,
    tau_c_text="3 theta",
    default_tau_c=default_tau_c_integrating,
)
