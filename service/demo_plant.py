"""What the demo shows: the simulated plant, and what its engineers made of it."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from loop.plants import PLANT, SimulatedLoop
from loop.process import IPDT
from service.actors import Actor, Role
from service.loops.schemas import Form, GainBasis, TimeUnit

ENGINEER = Actor(owner="Anna Berg", role=Role.ENGINEER)
APPROVER = Actor(owner="Jonas Lind", role=Role.APPROVER)

Choice: TypeAlias = Literal["as found", "recommended"] | tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoSheet:
    """One version of a loop sheet in the demo.

    Attributes
    ----------
    settings : str or tuple of str
        "as found", "recommended", or the rule and structure of the tuning.
    reason : str
        Why the engineer wrote it.
    decision : str or None
        What the approver did with it; none leaves a draft.
    decision_reason : str
        Why.
    """

    settings: Choice
    reason: str
    decision: Literal["approved", "rejected"] | None = None
    decision_reason: str = ""


AS_FOUND = DemoSheet(
    settings="as found",
    reason="The settings that ran in the controller when the loop was taken into the system.",
    decision="approved",
    decision_reason="Compared with the controller on 2 March; they agree.",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoLoop:
    """A loop of the simulated plant, and what an engineer would add to it.

    Attributes
    ----------
    plant : SimulatedLoop
        The simulated loop.
    form, time_unit, gain_basis : str
        How its controller block writes its settings.
    stated : IPDT or None
        Process that the engineer states where the step test shows no first-order process.
    sheets : tuple of DemoSheet
        Versions of its sheet.
    """

    plant: SimulatedLoop
    form: Form = "isa"
    time_unit: TimeUnit = "s"
    gain_basis: GainBasis = "eu"
    stated: IPDT | None = None
    sheets: tuple[DemoSheet, ...] = (AS_FOUND,)


FIC101, PIC102, LIC103, TIC201, TIC202, TIC203 = PLANT
DEMO = (
    DemoLoop(plant=FIC101),
    DemoLoop(plant=PIC102, form="parallel", gain_basis="percent"),
    DemoLoop(
        plant=LIC103,
        time_unit="min",
        gain_basis="percent",
        # In round numbers, as an engineer knows the level; the step test says the same.
        stated=IPDT(K=-0.006, theta=9.0),
    ),
    DemoLoop(
        plant=TIC201,
        sheets=(
            AS_FOUND,
            DemoSheet(
                settings="recommended",
                reason="Step test of 2 March: the recommended settings reject loads twice as fast "
                "and keep the general profile under ±50 % of model error.",
                decision="approved",
                decision_reason="Agreed in the weekly meeting; put in on 4 March.",
            ),
            DemoSheet(
                settings=("amigo", "PID"),
                reason="For discussion: derivative action for the faster feed changes in summer.",
            ),
        ),
    ),
    DemoLoop(
        plant=TIC202,
        time_unit="min",
        gain_basis="percent",
        sheets=(
            AS_FOUND,
            DemoSheet(
                settings="recommended",
                reason="The loop is several times slower than its step test of 2 March allows.",
            ),
        ),
    ),
    DemoLoop(
        plant=TIC203,
        form="series",
        sheets=(
            AS_FOUND,
            DemoSheet(
                settings=("ziegler_nichols_reaction_curve", "PI"),
                reason="First try against the oscillation.",
                decision="rejected",
                decision_reason="Does not keep the profile: see the worst case of its sweep.",
            ),
            DemoSheet(
                settings="recommended",
                reason="Against the oscillation; keeps the profile under ±50 % of model error.",
            ),
        ),
    ),
)
