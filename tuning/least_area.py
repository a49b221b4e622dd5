"""What is told of settings that are computed and not published: their name, aim and source."""

from types import MappingProxyType

from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import Process
from tuning.rule import Formula, Rule, no_notes

TITLE = "Least load area"
NAME = "least_area"
STRUCTURES = ("PI", "PID")


def _asked(structure: str) -> Formula:
    def tune(process: Process, tau_c: float | None = None) -> PID:  # noqa: ARG001 - a rule's signature
        raise RuleNotApplicable(
            f"{TITLE} {structure}", "it is computed for one profile and not by a formula"
        )

    return tune


RULE = Rule(
    name=NAME,
    title=TITLE,
    source="computed, not published",
    status="confirmed",
    aim="least error after a load under proven limits",
    form="ISA",
    validity="second order that swings by itself",
    structures=MappingProxyType({structure: _asked(structure) for structure in STRUCTURES}),
    takes=MappingProxyType(dict.fromkeys(STRUCTURES, ("TransferFunction",))),
    notes=no_notes,
)
