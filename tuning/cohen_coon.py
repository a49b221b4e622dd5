"""Cohen-Coon settings from a first-order model with dead time.

Source: G. H. Cohen and G. A. Coon, "Theoretical consideration of retarded control,"
Trans. ASME, vol. 75, pp. 827-834, 1953. The original was not read; the formulas are as quoted by
two public sources. A PI constant of 1.1 is also in circulation: computed here, 0.9 gives a
dominant decay ratio of .261, .251, .222 at theta/tau .1, .25, .5 and 1.1 gives .544, .514, .450,
and the aim is a quarter, so 0.9 it is.

Range: none was found in what was read; the formulas are first-order expansions in r = theta/tau,
and the PD column ends at r = 3, where its Td reaches 0.
"""

from types import MappingProxyType

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, Process
from tuning.rule import Rule, accept, require_dead_time, without_speed

TITLE = "Cohen-Coon"


def _terms(process: Process) -> tuple[float, float, float, Action]:
    """Return 1/(K r), r, theta and the action."""
    model = accept(process, FOPDT, TITLE)
    theta = require_dead_time(model, TITLE)
    r = theta / model.tau
    return 1 / (abs(model.K) * r), r, theta, Action.for_gain(model.K)


def cohen_coon_p(process: Process) -> PID:
    """Tune a P controller: Kc = (tau/(K theta)) (1 + r/3), r = theta/tau.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> round(cohen_coon_p(FOPDT(K=1.0, tau=2.0, theta=1.0)).Kc, 5)
    2.33333
    """
    unit, r, _, action = _terms(process)
    return PID(Kc=unit * (1 + r / 3), action=action)


def cohen_coon_pi(process: Process) -> PID:
    """Tune a PI controller.

    Kc = (tau/(K theta)) (0.9 + r/12), Ti = theta (30 + 3 r)/(9 + 20 r), r = theta/tau.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = cohen_coon_pi(FOPDT(K=1.0, tau=2.0, theta=1.0))
    >>> round(pid.Kc, 5), round(pid.Ti, 5)
    (1.88333, 1.65789)
    """
    unit, r, theta, action = _terms(process)
    return PID(Kc=unit * (0.9 + r / 12), Ti=theta * (30 + 3 * r) / (9 + 20 * r), action=action)


def cohen_coon_pd(process: Process) -> PID:
    """Tune a PD controller.

    Kc = (tau/(K theta)) (1.25 + r/6), Td = theta (6 - 2 r)/(22 + 3 r), r = theta/tau.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, theta/tau is 3 or more (Td would not be positive), or the process
        has another type.

    Examples
    --------
    >>> pid = cohen_coon_pd(FOPDT(K=1.0, tau=2.0, theta=1.0))
    >>> round(pid.Kc, 5), round(pid.Td, 5)
    (2.66667, 0.21277)
    """
    unit, r, theta, action = _terms(process)
    if r >= 3:
        raise RuleNotApplicable(
            f"{TITLE} PD", f"its Td is positive for theta/tau below 3 only, here it is {r:.3g}"
        )
    return PID(Kc=unit * (1.25 + r / 6), Td=theta * (6 - 2 * r) / (22 + 3 * r), action=action)


def cohen_coon_pid(process: Process) -> PID:
    """Tune a PID controller.

    Kc = (tau/(K theta)) (4/3 + r/4), Ti = theta (32 + 6 r)/(13 + 8 r),
    Td = 4 theta/(11 + 2 r), r = theta/tau.

    Parameters
    ----------
    process : FOPDT
        Process model. [s]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.

    Examples
    --------
    >>> pid = cohen_coon_pid(FOPDT(K=1.0, tau=2.0, theta=1.0))
    >>> round(pid.Kc, 5), round(pid.Ti, 5), round(pid.Td, 5)
    (2.91667, 2.05882, 0.33333)
    """
    unit, r, theta, action = _terms(process)
    return PID(
        Kc=unit * (4 / 3 + r / 4),
        Ti=theta * (32 + 6 * r) / (13 + 8 * r),
        Td=4 * theta / (11 + 2 * r),
        action=action,
    )


def _notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001
    model = accept(process, FOPDT, TITLE)
    ratio = model.theta / model.tau
    if not 0.1 <= ratio <= 1:
        return (
            f"theta/tau is {ratio:.3g}; the decay of a quarter was checked here for 0.1 to 0.5, "
            "and no printed range was found",
        )
    return ()


NAME = "cohen_coon"
RULE = Rule(
    name=NAME,
    title=TITLE,
    source="Cohen & Coon 1953, Trans. ASME 75, 827-834",
    status="confirmed",
    aim="quarter decay of the dominant oscillation after a load disturbance",
    form="ISA",
    validity="no range was found in what was read; PD for theta/tau below 3",
    structures=MappingProxyType(
        {
            "P": without_speed(NAME, cohen_coon_p),
            "PI": without_speed(NAME, cohen_coon_pi),
            "PD": without_speed(NAME, cohen_coon_pd),
            "PID": without_speed(NAME, cohen_coon_pid),
        }
    ),
    takes=MappingProxyType(dict.fromkeys(("P", "PI", "PD", "PID"), ("FOPDT",))),
    notes=_notes,
)
