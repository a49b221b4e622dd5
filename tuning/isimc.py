"""Improved SIMC settings for a first-order model with dead time.

Source: C. Grimholt and S. Skogestad, "Optimal PI-control and verification of the SIMC tuning
rule," IFAC Conf. Advances in PID Control, 2012 (PI), and "Optimal PI and PID control of
first-order plus delay processes and evaluation of the original and improved SIMC rules,"
J. Process Control, vol. 70, pp. 36-46, 2018 (PID). The originals were not read; the change (a
third of the dead time, added to tau or as a series Td) is as quoted by two public sources.
Computed here: PID at tau_c = theta has Ms 1.433 and at theta/2 1.659; PI at tau = theta 1.683.

The PID column is in the SERIES form, converted here exactly with a derivative filter of 0.05
times the shorter of the series Ti and Td.

Range: as SIMC, tau_c >= theta; theta/2 is said to be typical for the PID (from memory).
"""

from types import MappingProxyType

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, Process
from tuning.rule import Rule, accept, chosen_tau_c
from tuning.series_form import series_to_isa
from tuning.simc import FILTER, default_tau_c, notes


def isimc_pi(process: Process, tau_c: float | None = None) -> PID:
    """Tune a PI controller.

    Kc = (tau + theta/3)/(K (tau_c + theta)), Ti = min(tau + theta/3, 4 (tau_c + theta)).

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: theta. [s]

    Raises
    ------
    RuleNotApplicable
        There is neither a dead time nor a tau_c, or the process has another type.

    Examples
    --------
    >>> pid = isimc_pi(FOPDT(K=2.0, tau=120.0, theta=30.0))
    >>> round(pid.Kc, 5), pid.Ti
    (1.08333, 130.0)
    """
    rule = "Improved SIMC PI"
    model = accept(process, FOPDT, rule)
    wait = chosen_tau_c(tau_c, default_tau_c(model), rule) + model.theta
    lag = model.tau + model.theta / 3
    return PID(
        Kc=lag / (abs(model.K) * wait), Ti=min(lag, 4 * wait), action=Action.for_gain(model.K)
    )


def isimc_pid(process: Process, tau_c: float | None = None, *, alpha: float = FILTER) -> PID:
    """Tune a PID controller.

    Series form: Kc = tau/(K (tau_c + theta)), Ti = min(tau, 4 (tau_c + theta)), Td = theta/3.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant. Default: theta. [s]
    alpha : float
        Time of the derivative filter over the shorter of the series Ti and Td. [-]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = isimc_pid(FOPDT(K=2.0, tau=120.0, theta=30.0), alpha=0.0)
    >>> round(pid.Kc, 5), pid.Ti, round(pid.Td, 5)  # 1, 120 and 10 in the series form
    (1.08333, 130.0, 9.23077)
    """
    rule = "Improved SIMC PID"
    model = accept(process, FOPDT, rule)
    if model.theta == 0:
        raise RuleNotApplicable(rule, "without dead time its Td is 0: take SIMC PI")
    wait = chosen_tau_c(tau_c, default_tau_c(model), rule) + model.theta
    return series_to_isa(
        Kc=model.tau / (abs(model.K) * wait),
        Ti=min(model.tau, 4 * wait),
        Td=model.theta / 3,
        alpha=alpha,
        K=model.K,
    )


RULE = Rule(
    name="isimc",
    title="Improved SIMC",
    source="Grimholt & Skogestad 2012 (PI) and 2018, J. Process Control 70, 36-46 (PID)",
    status="confirmed",
    aim="SIMC's response with the better use of a dominant dead time",
    form="series",
    validity="tau_c >= theta; theta/2 for the PID is from memory",
    structures=MappingProxyType({"PI": isimc_pi, "PID": isimc_pid}),
    takes=MappingProxyType({"PI": ("FOPDT",), "PID": ("FOPDT",)}),
    notes=notes,
    tau_c_text="theta",
    default_tau_c=default_tau_c,
)
