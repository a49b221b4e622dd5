"""PI settings for a process that is nothing but a gain with dead time.

Source: S. Skogestad, 2003, by the name a public program gives it, from memory. The original was
not read and no second source was found. Computed elsewhere, the PI with the least load and
set-point error at Ms 1.59 has K Kc = 0.199 and Ti = 0.321 theta, close to it.

Range: a process without any lag.
"""

from types import MappingProxyType

from loop.controller import PID, Action
from loop.process import Process, PureDelay
from tuning.rule import Rule, no_notes, refuse_type, without_speed

TITLE = "Pure-delay PI"


def pure_delay_pi(process: Process) -> PID:
    """Tune a PI controller: Kc = 0.2/K, Ti = 0.318 theta.

    Parameters
    ----------
    process : PureDelay
        Process model. [s]

    Raises
    ------
    RuleNotApplicable
        The process has another type.

    Examples
    --------
    >>> pid = pure_delay_pi(PureDelay(K=2.0, theta=10.0))
    >>> pid.Kc, pid.Ti
    (0.1, 3.18)
    """
    if not isinstance(process, PureDelay):
        raise refuse_type(process, ("PureDelay",), TITLE)
    return PID(Kc=0.2 / abs(process.K), Ti=0.318 * process.theta, action=Action.for_gain(process.K))


NAME = "pure_delay_pi"
RULE = Rule(
    name=NAME,
    title=TITLE,
    source="Skogestad 2003, as a public program has it, from memory",
    status="memory",
    aim="fast rejection of loads on a process without lag",
    form="ISA",
    validity="a gain with dead time and nothing else",
    structures=MappingProxyType({"PI": without_speed(NAME, pure_delay_pi)}),
    takes=MappingProxyType({"PI": ("PureDelay",)}),
    notes=no_notes,
)
