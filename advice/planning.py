"""Plans of tests for people and for machines: the sentences of a plan, and its JSON document."""

from dataclasses import asdict
from typing import Literal, TypeAlias

from advice.body import Body
from advice.display import digits
from identification.planner import StepPlan, Wishes, plan_steps
from identification.relay_planner import RelayPlan, plan_relay

Plan: TypeAlias = StepPlan | RelayPlan
Kind: TypeAlias = Literal["steps", "relay"]


def plan_test(wishes: Wishes, kind: Kind = "steps") -> Plan:
    """Plan a test of one kind.

    Parameters
    ----------
    wishes : Wishes
        What is known and wanted.
    kind : str
        Moves of OP in manual, or a relay.

    Raises
    ------
    NoLimitCycle
        A relay would not cycle clear of the noise.
    """
    return plan_relay(wishes) if kind == "relay" else plan_steps(wishes)


def plan_sentences(plan: Plan) -> list[str]:
    """Say what to do, what to expect and when to stop, for the person at the plant."""
    if isinstance(plan, RelayPlan):
        first = [
            f"With PV at rest, record {digits(plan.rest, 3)} s, then let a relay switch OP between "
            f"{plan.bias + plan.amplitude:+.4g} and {plan.bias - plan.amplitude:+.4g} about OP at "
            f"rest, with a hysteresis of ±{digits(plan.hysteresis, 3)} about PV at rest, for "
            f"{plan.cycles} cycles.",
            f"Expect a period of {digits(plan.period, 3)} s with PV between {plan.lowest:+.3g} and "
            f"{plan.highest:+.3g} about rest; up to {digits(plan.longest_period, 3)} s should the "
            "process be slower than guessed.",
        ]
        silence = f"OP has not switched for {digits(plan.abort_silence, 3)} s"
    else:
        moves = ", ".join(f"{level:+.4g}" for level in plan.levels)
        first = [
            f"In manual, with PV at rest, record {digits(plan.rest, 3)} s, then put OP to {moves} "
            f"about its value at rest, for {digits(plan.hold, 3)} s each.",
            f"Expect PV to move by {plan.answer:+.3g} after the first move.",
        ]
        silence = f"PV has not moved {digits(plan.abort_silence, 3)} s after the first move"
    K, tau, theta = (digits(1.96 * error, 2) for error in plan.expected_errors)
    return [
        *first,
        f"It takes {digits(plan.duration, 3)} s; store samples every "
        f"{digits(plan.sample_time, 3)} s or faster, without compression.",
        f"Stop and put OP back if PV is {digits(plan.abort_deviation, 3)} or more from rest, if "
        f"{silence}, or after {digits(plan.abort_time, 3)} s.",
        f"Expected errors: K ± {K}, tau ± {tau} s, theta ± {theta} s (95 %), within "
        f"±{100 * plan.largest_width:.2g} % should the guess be off.",
        *(remark[:1].upper() + remark[1:] + "." for remark in plan.remarks),
    ]


def plan_body(plan: Plan) -> Body:
    """The plan as the JSON document of REST and command line."""
    values: Body = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in asdict(plan).items()
    }
    kind = "relay" if isinstance(plan, RelayPlan) else "steps"
    return {"kind": kind, **values, "instructions": list(plan_sentences(plan))}
