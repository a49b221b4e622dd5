"""Shinskey's PI settings from the reaction curve.

Source: F. G. Shinskey, 2000, as listed in A. O'Dwyer's handbook of tuning rules. The originals were
not read; a public source quotes the formula from the handbook, and a second one has it with
3.78 tau for Ti, which has not the right limit for an integrator and is taken for a misprint.

Range: none was found in what was read.
"""

from types import MappingProxyType

from loop.controller import PID, Action
from loop.process import Process
from tuning.rule import Rule, dead_time_ratio, no_notes, without_speed

TITLE = "Shinskey"


def shinskey_pi(process: Process) -> PID:
    """Tune a PI controller: Kc = 0.667 tau/(K theta), Ti = 3.78 theta.

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
    >>> from loop.process import FOPDT
    >>> pid = shinskey_pi(FOPDT(K=1.0, tau=2.0, theta=1.0))
    >>> pid.Kc, pid.Ti
    (1.334, 3.78)
    """
    model, r = dead_time_ratio(process, TITLE)
    return PID(
        Kc=0.667 / (abs(model.K) * r), Ti=3.78 * model.theta, action=Action.for_gain(model.K)
    )


NAME = "shinskey"
RULE = Rule(
    name=NAME,
    title=TITLE,
    source="Shinskey 2000, as listed by O'Dwyer",
    status="confirmed",
    aim="not stated in what was read; for load disturbances, from memory",
    form="ISA",
    validity="no range was found in what was read",
    structures=MappingProxyType({"PI": without_speed(NAME, shinskey_pi)}),
    takes=MappingProxyType({"PI": ("FOPDT",)}),
    notes=no_notes,
)
