"""The law of a PID as a regression of the output on its terms, over stretches in automatic."""

import math
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import minimize
from scipy.signal import lfilter

from identification.even_record import EvenRecord
from identification.quality import residual_colour
from loop.errors import PoorExcitation
from loop.regression import Regression, least_squares
from loop.signals import Flags, Real

# Rows in automatic, off the limits, without a gap: for a stretch, and in all.
FEWEST, FEWEST_IN_ALL, MOST_IN_ALL = 20, 60, 20_000
# An output that stays so long at the end of its range is held there by the limit.
AT_LIMIT = 2
# Rows that share a bias: recording errors of PV add up in the integral, so that a long record tells
# less as a whole than in parts.
CHUNKS = (None, 1000, 300, 100, 30)
# Filter and lag times after which their start is forgotten.
SETTLED = 5.0
TINY = float(np.finfo(np.float64).tiny)
# Filter and lag times tried, in samples.
FILTERS = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
LAGS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
# A term is there when leaving it out raises what is left by so much, and it beats its own error.
WORTH, THERE = 1.2, 4.0
# Rounding against what the law leaves.
EXACT = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """SP, PV and OP of one stretch in automatic, off the limits of the output."""

    sp: Real
    pv: Real
    op: Real


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """Which terms the law has, its filter and lag times, its timing, the rows to a bias."""

    terms: tuple[str, ...]
    late: int = 0
    Tf: float = 0.0
    tauF: float = 0.0
    chunk: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Law:
    """One form of the law with its fit; coefficients in the order of `names`."""

    names: tuple[str, ...]
    form: Form
    fit: Regression
    spread: float

    def value(self, name: str) -> float:
        """Coefficient of a term, 0 where the law has none."""
        return float(self.fit.coefficients[self.names.index(name)]) if name in self.names else 0.0

    @property
    def left(self) -> float:
        """Standard deviation of what the law leaves. [OP]"""
        return math.sqrt(self.fit.noise_variance)


def automatic_stretches(even: EvenRecord) -> list[Stretch]:
    """Longest stretches in automatic, off the limits, with a set point."""
    usable: Flags = even.known & even.automatic & np.isfinite(even.sp) & ~_at_limits(even.op)
    edges = np.flatnonzero(np.diff(usable.astype(int), prepend=0, append=0)).tolist()
    spans = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= FEWEST]
    spans.sort(key=lambda span: span[0] - span[1])
    rows = 0
    kept = []
    for a, b in spans:
        if rows < MOST_IN_ALL:
            part = slice(a, min(b, a + MOST_IN_ALL - rows))
            rows += part.stop - a
            kept.append(Stretch(sp=even.sp[part], pv=even.pv[part], op=even.op[part]))
    if rows < FEWEST_IN_ALL:
        raise PoorExcitation(
            f"{rows} rows in automatic with set point, PV and OP, off the limits of OP and without "
            f"a gap, are too few; settings need {FEWEST_IN_ALL}."
        )
    if all(np.ptp(s.op) == 0 for s in kept):
        raise PoorExcitation(f"OP stands at {kept[0].op[0]:.4g} in automatic.")
    if all(np.ptp(s.pv) == 0 and np.ptp(s.sp) == 0 for s in kept):
        raise PoorExcitation("Neither PV nor the set point moved in automatic.")
    return kept


def _at_limits(op: Real) -> Flags:
    """Rows where the output stays at the end of its range."""
    held = np.zeros(op.size, dtype=np.bool_)
    if not np.any(np.isfinite(op)):
        return held
    for end in (np.nanmin(op), np.nanmax(op)):
        edges = np.flatnonzero(np.diff((op == end).astype(int), prepend=0, append=0)).tolist()
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            held[a:b] |= b - a >= AT_LIMIT
    return held


def best_law(stretches: list[Stretch], dt: float) -> Law:
    """Simplest law that leaves no more than a fuller one, at the timing that leaves least.

    Parameters
    ----------
    stretches : list of Stretch
        Rows to use.
    dt : float
        Their spacing. [s]

    Raises
    ------
    PoorExcitation
        Nothing tells the terms of the law apart.
    """
    plain = [Form(terms=("P", "I"), late=late) for late in (0, 1)]
    law = min(_fits(stretches, dt, plain), key=lambda one: one.left)
    if law.left > EXACT * law.spread:
        forms = [
            Form(terms=terms, Tf=Tf * dt, tauF=tauF * dt, late=late)
            for terms, Tfs in ((("P", "I"), (0.0,)), (("P", "I", "D"), FILTERS))
            for Tf, tauF, late in product(Tfs, LAGS, (0, 1))
        ]
        fuller = min(_fits(stretches, dt, forms), key=lambda one: one.left)
        if fuller.left * WORTH < law.left:
            law = _polished(stretches, dt, fuller)
    if law.value("D") / law.value("P") < law.form.Tf:  # a filter slower than what it filters
        law = _fit(stretches, dt, replace(law.form, terms=("P", "I"), Tf=0.0))
    chunked = [replace(law.form, chunk=chunk) for chunk in CHUNKS]
    law = min(_fits(stretches, dt, chunked), key=_uncertainty)
    if abs(law.value("I")) < THERE * coefficient_error(law, "I"):
        terms = tuple(n for n in law.form.terms if n != "I")
        without = _fit(stretches, dt, replace(law.form, terms=terms))
        if without.left < WORTH * law.left:
            law = without
    return law


def _fits(stretches: list[Stretch], dt: float, forms: list[Form]) -> list[Law]:
    """Fits of all forms whose terms the rows tell apart, at least one."""
    laws, last = [], PoorExcitation("No law could be fitted.")
    for form in forms:
        try:
            laws.append(_fit(stretches, dt, form))
        except PoorExcitation as fact:
            last = fact
    if not laws:
        raise last
    return laws


def _polished(stretches: list[Stretch], dt: float, law: Law) -> Law:
    """Refine the filter and lag times between the points of the grid."""
    names = [name for name in ("Tf", "tauF") if getattr(law.form, name)]

    def at(logs: Real) -> Law:
        times = dict(zip(names, np.exp(np.clip(logs, -20.0, 20.0)).tolist(), strict=True))
        return _fit(stretches, dt, replace(law.form, **times))

    def error(logs: Real) -> float:
        return at(logs).left / law.spread

    if not names:
        return law
    start: Real = np.log(np.array([getattr(law.form, name) for name in names]))
    around = start + np.vstack((np.zeros(len(names)), 0.3 * np.eye(len(names))))
    found = minimize(
        error, start, method="Nelder-Mead", options={"initial_simplex": around, "maxfev": 120}
    )
    return at(found.x)


def _uncertainty(law: Law) -> float:
    """Largest relative error of the proportional and the integral part."""
    return max(
        coefficient_error(law, name) / max(abs(law.value(name)), TINY)
        for name in law.names
        if name in "PI"
    )


def _fit(stretches: list[Stretch], dt: float, form: Form) -> Law:
    """Regress the output on the terms, every chunk of every stretch about its own mean."""
    moved = any(np.ptp(s.sp) > 0 for s in stretches)
    names = (
        *form.terms,
        *(("b",) if moved else ()),
        *(("c",) if moved and "D" in form.terms else ()),
    )
    blocks = []
    settle = min(
        int(SETTLED * max(form.Tf, form.tauF) / dt), min(s.pv.size for s in stretches) // 2
    )
    for s in stretches:
        n = s.sp.size - form.late
        terms = [_term(name, s.sp[:n], s.pv[:n], dt, form) for name in names]
        block = np.column_stack((*terms, s.op[form.late :]))[settle:]
        size = block.shape[0] if form.chunk is None else form.chunk
        for first in range(0, max(block.shape[0] - size // 2, 1), size):
            chunk = block[first : first + size]
            blocks.append(chunk - chunk.mean(axis=0))
    table = np.concatenate(blocks)
    return Law(
        names=names,
        form=form,
        fit=least_squares(table[:, :-1], table[:, -1]),
        spread=float(np.std(table[:, -1])),
    )


def _term(name: str, sp: Real, pv: Real, dt: float, form: Form) -> Real:
    """One term of the law as `loop.digital_pid` runs it: PV straight between samples, SP held."""
    match name:
        case "P":
            term = -pv
        case "b":
            term = sp
        case "I":
            error = sp[:-1] - (pv[1:] + pv[:-1]) / 2
            term = np.concatenate(([0.0], np.cumsum(error) * dt))
        case "D":
            term = -_rate(pv, dt, form.Tf)
        case _:
            term = _rate(sp, dt, form.Tf)
    if form.tauF:
        keep = math.exp(-dt / form.tauF)
        lag = (1 - keep) * form.tauF / dt
        about = term - term[0]
        term = np.asarray(lfilter([1 - lag, lag - keep], [1.0, -keep], about))
    return term


def _rate(signal: Real, dt: float, Tf: float) -> Real:
    """Filtered slope of a signal that starts at rest."""
    keep = math.exp(-dt / Tf) if Tf else 0.0
    return np.asarray(
        lfilter([1.0], [1.0, -keep], np.diff(signal, prepend=signal[0])) * (1 - keep) / dt
    )


def coefficient_error(law: Law, name: str) -> float:
    """Standard error of a coefficient, widened by the colour of what is left."""
    known = law.fit.residuals[np.isfinite(law.fit.residuals)]
    wide = math.sqrt(residual_colour(known).inflation)
    return float(law.fit.standard_errors[law.names.index(name)]) * wide
