"""A published tuning rule as data: its formulas, source, range and default speed."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Literal, Protocol, TypeAlias, TypeVar

from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT, LARGEST, SMALLEST, SOPDT, DoubleIntegrator, Process
from tuning.ultimate import UltimatePoint, ultimate_point

Status: TypeAlias = Literal["confirmed", "memory"]
P = TypeVar("P", FOPDT, IPDT, SOPDT, DoubleIntegrator)
C = TypeVar("C")

STATUS_TEXT: Mapping[Status, str] = {
    "confirmed": "the original was not read; a second public source or a computation agrees",
    "memory": "cited from memory and not confirmed: check it before use",
}


class Formula(Protocol):
    """One published column of a rule: a process in, controller settings out."""

    def __call__(self, process: Process, tau_c: float | None = None) -> PID:
        """Tune a controller for the process, at tau_c [s] where the rule has that choice."""
        ...


FromUltimate: TypeAlias = Callable[[UltimatePoint], PID]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rule:
    """A published tuning rule and everything a reader needs to judge it.

    Attributes
    ----------
    name : str
        Key in the catalogue.
    title : str
        Name in print.
    source : str
        Where it was published; the module's docstring says what was read of it.
    status : str
        "confirmed" or "memory"; see `STATUS_TEXT`.
    aim : str
        What the rule was made for.
    form : str
        Controller form in which the rule was published: "ISA" or "series".
    validity : str
        The published range, with the doubt about it.
    structures : mapping of str to Formula
        The published columns, P PI PD PID: `(process, tau_c=None) -> PID`.
    takes : mapping of str to tuple of str
        Process types that each structure takes.
    tau_c_text : str, optional
        The default desired closed-loop time constant as a formula; None where the rule has no
        such choice.
    default_tau_c : callable, optional
        The same as a function. [s]
    notes : callable
        `(structure, process, tau_c) -> sentences` on these very settings: outside the range, what
        is from memory, what was converted.
    from_ultimate : mapping, optional
        The columns as functions of an ultimate point, for rules that rest on Ku and Pu alone.
    """

    name: str
    title: str
    source: str
    status: Status
    aim: str
    form: Literal["ISA", "series"]
    validity: str
    structures: Mapping[str, Formula]
    takes: Mapping[str, tuple[str, ...]]
    notes: Callable[[str, Process, float | None], tuple[str, ...]]
    tau_c_text: str | None = None
    default_tau_c: Callable[[Process], float] | None = None
    from_ultimate: Mapping[str, FromUltimate] | None = None

    @property
    def uses_tau_c(self) -> bool:
        """Whether a desired closed-loop time constant may be chosen."""
        return self.default_tau_c is not None


def accept(process: Process, kind: type[P], rule: str) -> P:
    """Return the process as the type the rule takes.

    Parameters
    ----------
    process : Process
        Process model of any type.
    kind : type
        Type the rule takes.
    rule : str
        Title of the rule, for the sentence of the refusal.

    Raises
    ------
    RuleNotApplicable
        The process is of another type.
    """
    if not isinstance(process, kind):
        raise refuse_type(process, (kind.__name__,), rule)
    return process


def refuse_type(process: Process, kinds: tuple[str, ...], rule: str) -> RuleNotApplicable:
    """Say which process types the rule takes."""
    return RuleNotApplicable(rule, f"it takes {' or '.join(kinds)}, not {type(process).__name__}")


def require_dead_time(process: FOPDT | IPDT, rule: str) -> float:
    """Return theta, which the rule divides by. [s]

    Raises
    ------
    RuleNotApplicable
        theta is 0.
    """
    if process.theta == 0:
        raise RuleNotApplicable(rule, "it divides by the dead time, which is 0 here")
    return process.theta


def dead_time_ratio(process: Process, rule: str) -> tuple[FOPDT, float]:
    """Return the first-order model and r = theta/tau, which is not 0. [-]

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or the process has another type.
    """
    model = accept(process, FOPDT, rule)
    return model, require_dead_time(model, rule) / model.tau


def chosen_tau_c(tau_c: float | None, default: float, rule: str) -> float:
    """Check a chosen closed-loop time constant, or take the default. [s]

    Parameters
    ----------
    tau_c : float or None
        The choice, None for the default. [s]
    default : float
        What the rule's formula gives; 0 where it needs a dead time that is not there. [s]
    rule : str
        Title of the rule.

    Raises
    ------
    ValueError
        tau_c is not a positive number.
    RuleNotApplicable
        Nothing was chosen and the default is 0.
    """
    if tau_c is not None:
        check_tau_c(tau_c)
        return tau_c
    if default <= 0:
        raise RuleNotApplicable(rule, "without dead time a positive tau_c must be chosen")
    return default


def check_tau_c(tau_c: float) -> None:
    """Check a chosen closed-loop time constant.

    Raises
    ------
    ValueError
        tau_c is not a number within the range of times.
    """
    if not (math.isfinite(tau_c) and SMALLEST <= tau_c <= LARGEST):
        raise ValueError(f"tau_c must lie within {SMALLEST:g} and {LARGEST:g} s, got {tau_c}")


def without_speed(name: str, formula: Callable[[Process], PID]) -> Formula:
    """Give a formula without tau_c the catalogue's signature; a tau_c is refused, not ignored."""

    @wraps(formula)
    def tune(process: Process, tau_c: float | None = None) -> PID:
        if tau_c is not None:
            raise ValueError(f"{name} has no tau_c to choose, got {tau_c}: leave it out")
        return formula(process)

    return tune


def one_of(formula: Callable[[Process, C], PID], choice: C) -> Callable[[Process], PID]:
    """Fix the column of a formula that is published as a table."""

    @wraps(formula)
    def tune(process: Process) -> PID:
        return formula(process, choice)

    return tune


def at_ultimate_point(name: str, title: str, formula: FromUltimate) -> Formula:
    """Feed a formula in Ku and Pu from the exact ultimate point of the process."""

    @wraps(formula)
    def tune(process: Process) -> PID:
        return formula(ultimate_point(process, rule=title))

    return without_speed(name, tune)


def no_notes(structure: str, process: Process, tau_c: float | None) -> tuple[str, ...]:  # noqa: ARG001 - one signature for all rules
    """Say nothing."""
    return ()
