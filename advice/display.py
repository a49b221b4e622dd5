"""Numbers and names as people read them: sensible digits, units, the same words everywhere."""

import math
from dataclasses import dataclass

from loop.controller import PID
from loop.margins import Margins
from tuning.answer import Tuning
from tuning.catalogue import rule_of
from tuning.proposals import Proposal


def digits(value: float | None, count: int = 4) -> str:
    """A number with `count` significant digits; a dash for none, a word for infinity."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "infinite" if value > 0 else "-infinite"
    if value == 0:
        return "0"
    decimals = count - 1 - math.floor(math.log10(abs(value)))
    if -3 <= decimals <= 8:
        return f"{round(value, decimals):.{max(decimals, 0)}f}"
    return f"{value:.{count - 1}e}"


def decibels(ratio: float) -> str:
    """A gain margin in dB."""
    return "infinite" if math.isinf(ratio) else f"{20 * math.log10(ratio):.1f}"


def rule_name(proposal: Proposal) -> str:
    """The rule with its structure, and its speed where it has one."""
    title = rule_of(proposal.rule).title
    words = title if title.split()[-1].startswith("PI") else f"{title} {proposal.structure}"
    if proposal.tau_c is None:
        return words
    return f"{words}, tau_c = {digits(proposal.tau_c, 3)} s"


def settings_of(pid: PID, gain_unit: str) -> tuple[str, ...]:
    """The settings to type, each with its unit."""
    shown = [
        f"Kc = {digits(pid.Kc)} {gain_unit}",
        "no integral" if pid.Ti == math.inf else f"Ti = {digits(pid.Ti)} s",
    ]
    if pid.Td:
        shown += [f"Td = {digits(pid.Td)} s", f"N = {digits(pid.N, 3)}"]
    shown.append(f"b = {digits(pid.b, 3)}")
    if pid.Td:
        shown.append(f"c = {digits(pid.c, 3)}")
    if pid.tauF:
        shown.append(f"tauF = {digits(pid.tauF)} s")
    return tuple(shown)


def settings_words(pid: PID) -> str:
    """The settings in one line, without the unit of the gain."""
    return ", ".join(part.strip() for part in settings_of(pid, ""))


def margins_words(found: Margins) -> str:
    """The margins of one loop in one line."""
    if not found.gain:  # how a sweep writes down a loop that is lost
        return "unstable"
    return (
        f"gain margin {decibels(found.gain)} dB, phase margin {digits(found.phase, 3)}°, delay "
        f"margin {digits(found.delay, 3)} s, Ms {digits(found.Ms, 3)}, Mt {digits(found.Mt, 3)}"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One rule's settings and margins, ready to print."""

    name: str
    Kc: str
    Ti: str
    Td: str
    N: str
    gain: str
    phase: str
    delay: str
    Ms: str
    worst_Ms: str
    verdict: str
    best: bool


def row_of(tuning: Tuning, *, best: bool) -> Row:
    """Print one rule that has an answer.

    Parameters
    ----------
    tuning : Tuning
        Settings, with their verification where a model carried one.
    best : bool
        Whether it is the recommended one.
    """
    pid, found = tuning.proposal.pid, tuning.verification
    if pid is None:
        raise ValueError("a refusal has no settings to print")
    margins = ("–",) * 5
    verdict = "not verified"
    full = tuning.full
    if found is not None and not (found.stable and (full is None or full.stable)):
        verdict = "unstable"
    elif found is not None:
        nominal = found.nominal if full is None else full.margins
        margins = (
            decibels(nominal.gain),
            digits(nominal.phase, 3),
            digits(nominal.delay, 3),
            digits(nominal.Ms, 3),
            digits(found.worst["Ms"].value, 3),
        )
        verdict = "passes" if tuning.passes else "fails"
    return Row(
        name=rule_name(tuning.proposal),
        Kc=digits(pid.Kc),
        Ti="–" if pid.Ti == math.inf else digits(pid.Ti),
        Td=digits(pid.Td) if pid.Td else "–",
        N=digits(pid.N, 3) if pid.Td else "–",
        gain=margins[0],
        phase=margins[1],
        delay=margins[2],
        Ms=margins[3],
        worst_Ms=margins[4],
        verdict=verdict,
        best=best,
    )
