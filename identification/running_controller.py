"""The settings that a controller really runs with, read from SP, PV and OP in automatic.

A controller is the one part of a loop that knows no noise: its output follows from set point and
PV by a law. What a regression of the output on the terms of that law leaves is therefore the
recording's own error, and says how far to believe the settings.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from identification.controller_law import (
    THERE,
    Law,
    Stretch,
    automatic_stretches,
    best_law,
    coefficient_error,
)
from identification.even_record import even_record
from identification.verdict import Finding, Verdict, graded, worst
from loop.controller import PID, Action
from loop.errors import LoopError
from loop.record import Record

# A law that leaves more of the output than this is not the whole law.
UNEXPLAINED, TOO_MUCH = 0.05, 0.25
# Relative half-widths of the 95 % intervals.
WIDE, TOO_WIDE = 0.1, 0.5
# Part of the proportional term's variance that the recording's resolution makes up.
BLURRED, TOO_BLURRED = 0.01, 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RunningController:
    """Settings in use, and how far to believe them.

    Attributes
    ----------
    pid : PID or None
        Settings in the ISA form; none where they are refused. b is 1 and c is 0 where the set
        point did not move.
    verdict : Verdict
        What they may be used for.
    reasons : tuple of str
        Why, the gravest first.
    Kc, Ti, Td : tuple of float or None
        95 % intervals. [OP/PV], [s], [s]
    unexplained : float or None
        Standard deviation of what the law leaves over that of the output. [-]
    late : int
        Samples by which the output follows PV, 0 or 1.
    rows : int
        Rows used.
    """

    pid: PID | None
    verdict: Verdict
    reasons: tuple[str, ...]
    Kc: tuple[float, float] | None = None
    Ti: tuple[float, float] | None = None
    Td: tuple[float, float] | None = None
    unexplained: float | None = None
    late: int = 0
    rows: int = 0


def running_controller(record: Record) -> RunningController:
    """Estimate Kc, Ti, Td and the form of the controller behind a record.

    u = Kc [(b sp - pv) + (1/Ti) int(sp - pv) + Td s/(1 + Tf s) (c sp - pv)]/(tauF s + 1) + bias

    The position form is fitted, with a bias of its own for every stretch in automatic: the errors
    of recording stay bounded in it, while differences of neighbours are mostly such errors. Rows at
    a limit of the output are left out. Series and parallel settings follow from the ISA ones; data
    cannot tell forms of the same law apart.

    Parameters
    ----------
    record : Record
        SP, PV, OP and, where there is one, MODE.

    Returns
    -------
    RunningController
        A refusal is a result too.

    Examples
    --------
    >>> from loop.experiment import Step
    >>> from loop.process import FOPDT
    >>> from loop.simulation import simulate
    >>> run = simulate(
    ...     FOPDT(K=2.0, tau=60.0, theta=10.0), PID(Kc=1.2, Ti=70.0), t_end=600.0, dt=1.0,
    ...     sp=Step(size=5.0, at=100.0), noise=0.1, rng=np.random.default_rng(1),
    ... )
    >>> found = running_controller(Record(t=run.t, sp=run.sp, pv=run.pv, op=run.op))
    >>> found.verdict.value, round(found.pid.Kc, 3), round(found.pid.Ti, 2)
    ('trusted', 1.2, 70.0)
    """
    try:
        even = even_record(record)
        stretches = automatic_stretches(even)
        law = best_law(stretches, even.dt)
    except LoopError as fact:
        return RunningController(pid=None, verdict=Verdict.REFUSED, reasons=(str(fact),))
    return _judged(law, stretches)


def _judged(law: Law, stretches: list[Stretch]) -> RunningController:
    """Settings and their verdict from the coefficients."""
    rows = law.fit.rows
    proportional = law.value("P")
    unexplained = law.left / law.spread
    facts = RunningController(
        pid=None, verdict=Verdict.REFUSED, reasons=(), unexplained=unexplained, late=law.form.late,
        rows=rows,
    )  # fmt: skip
    try:
        pid = _settings(law)
    except ValueError as impossible:
        return _refused(facts, f"The law that fits best is none of a PID: {impossible}.")
    width = float(student.ppf(0.975, rows - len(law.names)))
    Kc_error = width * coefficient_error(law, "P")
    parts = [Kc_error / abs(proportional)]
    Ti_part = 0.0
    if "I" in law.names:
        Ti_part = math.hypot(parts[0], width * coefficient_error(law, "I") / abs(law.value("I")))
        parts.append(Ti_part)
    Td_error = width * coefficient_error(law, "D") / abs(proportional) if "D" in law.names else 0.0
    findings = [
        _explained(unexplained),
        _known(max(parts), pid, parts[0], Ti_part),
        _resolution(stretches, law),
    ]
    verdict = worst(findings)
    order = [Verdict.REFUSED, Verdict.CARE, Verdict.TRUSTED]
    findings.sort(key=lambda finding: order.index(finding.verdict))
    return RunningController(
        pid=None if verdict is Verdict.REFUSED else pid,
        verdict=verdict,
        reasons=tuple(f.reason for f in findings),
        Kc=(pid.Kc - Kc_error, pid.Kc + Kc_error),
        Ti=None if pid.Ti == math.inf else (pid.Ti * (1 - Ti_part), pid.Ti * (1 + Ti_part)),
        Td=None if not pid.Td else (max(pid.Td - Td_error, 0.0), pid.Td + Td_error),
        unexplained=unexplained,
        late=law.form.late,
        rows=rows,
    )


def _refused(facts: RunningController, reason: str) -> RunningController:
    return RunningController(
        pid=None, verdict=Verdict.REFUSED, reasons=(reason,), unexplained=facts.unexplained,
        late=facts.late, rows=facts.rows,
    )  # fmt: skip


def _settings(law: Law) -> PID:
    proportional = law.value("P")
    action = Action.REVERSE if proportional > 0 else Action.DIRECT
    Kc = abs(proportional)
    integral, derivative = law.value("I"), law.value("D")
    Ti = proportional / integral if "I" in law.names else math.inf
    if Ti <= 0:
        raise ValueError("the integral acts against the proportional part")
    Td = derivative / proportional if "D" in law.names else 0.0
    if Td < 0:
        raise ValueError("the derivative acts against the proportional part")
    return PID(
        Kc=Kc,
        Ti=Ti,
        Td=Td,
        N=Td / law.form.Tf if law.form.Tf and Td else math.inf if Td else PID(Kc=1.0).N,
        b=_weight(law, "b", proportional, 1.0),
        c=_weight(law, "c", derivative, 0.0),
        tauF=law.form.tauF,
        action=action,
    )


def _weight(law: Law, name: str, own: float, default: float) -> float:
    """Set-point weight, taken as 0 or 1 where its error allows."""
    if name not in law.names or own == 0:
        return default
    weight = law.value(name) / own
    error = THERE * coefficient_error(law, name) / abs(own)
    near = 0.0 if weight < 0.5 else 1.0
    whole = abs(weight - near) <= max(error, 0.02)
    return float(near if whole else min(max(weight, 0.0), 2.0))


def _explained(unexplained: float) -> Finding:
    verdict = graded(unexplained, UNEXPLAINED, TOO_MUCH)
    text = f"The law leaves {unexplained:.2g} of the output's standard deviation unexplained"
    if verdict is not Verdict.TRUSTED:
        text += (
            ": something else moves the output (feed-forward, tracking, an operator), or the "
            "recorded PV is not quite the one that the controller sees"
        )
    return Finding(verdict=verdict, reason=f"{text}.")


def _known(widest: float, pid: PID, Kc_part: float, Ti_part: float) -> Finding:
    text = f"Kc = {pid.Kc:.4g} is known within ±{Kc_part:.1%}"
    text += f", Ti = {pid.Ti:.4g} s within ±{Ti_part:.1%} (95 %)." if Ti_part else " (95 %)."
    return Finding(verdict=graded(widest, WIDE, TOO_WIDE), reason=text)


def _resolution(stretches: list[Stretch], law: Law) -> Finding:
    """Ask how much of the proportional term is the resolution at which PV was recorded."""
    steps = np.concatenate([np.abs(np.diff(s.pv)) for s in stretches])
    steps = steps[steps > 0]
    step = float(steps.min()) if steps.size else 0.0
    tops = np.round(steps / step) if step else steps
    coarse = bool(step and np.all(np.abs(steps - tops * step) < 1e-3 * step))
    part = 0.0
    if coarse:
        own = max(law.fit.noise_variance, np.finfo(np.float64).tiny)
        error = float(law.fit.standard_errors[law.names.index("P")])
        # What the other terms leave of the proportional one: sum of squares = variance/error^2.
        part = law.fit.rows * step**2 / 12 / (own / max(error, 1e-300) ** 2)
    verdict = graded(part, BLURRED, TOO_BLURRED)
    text = "The resolution of the recorded PV is of no account."
    if verdict is not Verdict.TRUSTED:
        text = (
            f"PV is recorded in steps of {step:.3g}, which make up {part:.0%} of what tells the "
            f"proportional part, so Kc reads about that much too low."
        )
    return Finding(verdict=verdict, reason=text)
