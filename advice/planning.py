"""Plans of tests for people and for machines: the sentences of a plan, and its JSON document."""

import math
from dataclasses import asdict
from typing import Literal, TypeAlias

from advice.body import Body
from advice.display import digits
from identification.planner import StepPlan, Wishes, plan_steps
from identification.pulse_planner import PulsePlan, PulseWishes, plan_pulses
from identification.relay_planner import RelayPlan, plan_relay
from loop.process import FOPDT, IPDT

Plan: TypeAlias = StepPlan | RelayPlan | PulsePlan
Kind: TypeAlias = Literal["steps", "relay"]


def wishes_for(
    guess: FOPDT | IPDT,
    *,
    noise: float,
    deviation: float,
    precision: float = 0.1,
    factor: float = 1.5,
    room_up: float = math.inf,
    room_down: float = math.inf,
    sample_time: float | None = None,
) -> Wishes | PulseWishes:
    """Say what is known and wanted of a test, for a process that settles or integrates.

    Parameters
    ----------
    guess : FOPDT or IPDT
        Process as far as anybody knows.
    noise, deviation : float
        Noise of PV, and how far it may move from rest. [PV]
    precision, factor : float
        Wanted half-width of the 95 % intervals; how many times the parameters may be off. [-]
    room_up, room_down : float
        How far OP may move. [OP]
    sample_time : float, optional
        Where it cannot be chosen. [s]

    Raises
    ------
    ValueError
        A number cannot be.
    """
    limits = {
        "noise": noise, "deviation": deviation, "precision": precision, "factor": factor,
        "room_up": room_up, "room_down": room_down,
    }  # fmt: skip
    if isinstance(guess, IPDT):
        return PulseWishes(guess=guess, sample_time=sample_time, **limits)
    return Wishes(guess=guess, sample_time=sample_time, **limits)


def plan_test(wishes: Wishes | PulseWishes, kind: Kind = "steps") -> Plan:
    """Plan a test of one kind; the moves of a process that integrates are pulses.

    Parameters
    ----------
    wishes : Wishes or PulseWishes
        What is known and wanted.
    kind : str
        Moves of OP in manual, or a relay.

    Raises
    ------
    NoLimitCycle
        A relay would not cycle clear of the noise.
    ValueError
        A relay is wanted of a process that integrates.
    """
    if isinstance(wishes, PulseWishes):
        if kind == "relay":
            raise ValueError("relay tests are planned for FOPDT; an integrator gets pulses")
        return plan_pulses(wishes)
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
            f"about its value at rest, for {_lengths(plan)}.",
            f"Expect PV to move by {plan.answer:+.3g} {_when(plan)}.",
        ]
        silence = f"PV has not moved {digits(plan.abort_silence, 3)} s after the first move"
    names = ("K", "theta") if isinstance(plan, PulsePlan) else ("K", "tau", "theta")
    errors = ", ".join(
        f"{name} ± {digits(1.96 * error, 2)}" + ("" if name == "K" else " s")
        for name, error in zip(names, plan.expected_errors, strict=True)
    )
    return [
        *first,
        f"It takes {digits(plan.duration, 3)} s; store samples every "
        f"{digits(plan.sample_time, 3)} s or faster, without compression.",
        f"Stop and put OP back if PV is {digits(plan.abort_deviation, 3)} or more from rest, if "
        f"{silence}, or after {digits(plan.abort_time, 3)} s.",
        f"Expected errors: {errors} (95 %), {'K ' if isinstance(plan, PulsePlan) else ''}within "
        f"±{100 * plan.largest_width:.2g} % should the guess be off.",
        *(remark[:1].upper() + remark[1:] + "." for remark in plan.remarks),
    ]


def _lengths(plan: StepPlan | PulsePlan) -> str:
    hold = f"{digits(plan.hold, 3)} s"
    if isinstance(plan, StepPlan):
        return f"{hold} each"
    return f"{hold} each time away from rest and {digits(plan.rest, 3)} s back at it"


def _when(plan: StepPlan | PulsePlan) -> str:
    return "after the first move" if isinstance(plan, StepPlan) else "over the first pulse"


def plan_body(plan: Plan) -> Body:
    """The plan as the JSON document of REST and command line."""
    values: Body = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in asdict(plan).items()
    }
    kinds = {RelayPlan: "relay", PulsePlan: "pulses", StepPlan: "steps"}
    kind = kinds[type(plan)]
    return {"kind": kind, **values, "instructions": list(plan_sentences(plan))}
