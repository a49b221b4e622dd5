"""A schedule of settings over operating points, as a document and in words.

The command line, the REST service and a notebook all call this:

    from advice.schedule import schedule_for
    found = schedule_for([(20.0, FOPDT(K=1, tau=10, theta=2)), (80.0, FOPDT(K=3, tau=8, theta=2))])
"""

from collections.abc import Sequence

from advice.body import Body, margins_body, number, process_body, profile_body, settings_body
from advice.display import digits, settings_words
from loop.controller import PID
from loop.process import FOPDT
from tuning.catalogue import RULES
from tuning.gain_schedule import GainSchedule, gain_schedule
from tuning.profiles import DEFAULT_PROFILE
from tuning.rule import Rule

DEFAULT_RULE, DEFAULT_STRUCTURE = "simc", "PI"
# Of SIMC alone: tau_c = theta leaves the default profile as soon as the model is off.
SIMC_DEAD_TIMES = 2.0


def schedule_for(
    processes: Sequence[tuple[float, FOPDT]],
    *,
    rule: str = DEFAULT_RULE,
    structure: str = DEFAULT_STRUCTURE,
    tau_c: float | None = None,
    profile: str = DEFAULT_PROFILE,
) -> GainSchedule:
    """Tune at every operating point by one rule, and look between the points.

    Parameters
    ----------
    processes : sequence of (float, FOPDT)
        Scheduling variable and process at each operating point, two or more.
    rule, structure : str
        A rule of the catalogue, and one of its structures.
    tau_c : float, optional
        Desired closed-loop time constant at every point; the rule's own, of SIMC 2 theta, if not
        given. [s]
    profile : str
        Name of the profile to hold the margins to.

    Raises
    ------
    RuleNotApplicable
        The rule has no settings at a point.
    UnstableLoop
        Settings at a point do not even hold there.
    ValueError
        The points, the rule or tau_c cannot be.
    """
    chosen = _rule(rule, structure)

    def tune(process: FOPDT) -> PID:
        speed = tau_c
        if speed is None and rule == DEFAULT_RULE and process.theta:
            speed = SIMC_DEAD_TIMES * process.theta
        return chosen.structures[structure](process, speed)

    return gain_schedule(processes, rule=tune, profile=profile)


def _rule(name: str, structure: str) -> Rule:
    if name not in RULES:
        raise ValueError(f"rule must be one of {', '.join(RULES)}, got {name}")
    chosen = RULES[name]
    if structure not in chosen.structures:
        raise ValueError(
            f"structure of {name} must be one of {', '.join(chosen.structures)}, got {structure}"
        )
    return chosen


def schedule_body(found: GainSchedule) -> Body:
    """A schedule as the JSON document of command line and API."""
    return {
        "profile": profile_body(found.profile),
        "points": [
            {
                "at": point.at,
                "process": process_body(point.process),
                "settings": settings_body(point.pid),
                "margins": margins_body(point.margins),
            }
            for point in found.points
        ],
        "gaps": [
            {
                "low": gap.low,
                "high": gap.high,
                "held_Ms": number(gap.held_Ms),
                "between_Ms": number(gap.between_Ms),
                "steps": gap.steps,
                "lines": gap.lines,
            }
            for gap in found.gaps
        ],
        "sentences": list(schedule_sentences(found)),
    }


def schedule_sentences(found: GainSchedule) -> list[str]:
    """A schedule in words."""
    return [
        *(
            f"At {point.at:g}: {settings_words(point.pid)}; Ms {digits(point.margins.Ms, 3)}."
            for point in found.points
        ),
        *(
            f"Between {gap.low:g} and {gap.high:g}: Ms up to {digits(gap.held_Ms, 3)} where the "
            f"settings step, {digits(gap.between_Ms, 3)} half way on a line."
            for gap in found.gaps
        ),
        found.sentence,
    ]
