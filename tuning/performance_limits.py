"""What no linear controller, and what no PID, can do with a process: bounds with numbers."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from loop.bracket_solver import solve_brackets
from loop.controller import DEFAULT_N, PID
from loop.factors import FactoredLoop
from loop.feedback_sign import feedback_action
from loop.process import Process
from loop.signals import Complex, Real

# Where the all-pass part has turned this far, the ideal loop |1 - A| = 1 crosses over.
IDEAL_TURN = math.pi / 3
ON_THE_AXIS = 1e-9
POINTS = 4000


class Bound(StrEnum):
    """What a limit speaks of."""

    WC_BELOW = "wc at most"
    WC_ABOVE = "wc at least"
    MS = "Ms at least"
    MT = "Mt at least"


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """One bound that the process sets.

    Attributes
    ----------
    bound : Bound
        What is bounded.
    value : float
        Where. [rad/s] for wc, [-] for Ms and Mt
    cause : str
        What in the process sets it.
    rigorous : bool
        True where no stabilising linear controller can pass it; False for the crossover of the
        ideal loop, which a real one falls short of.
    """

    bound: Bound
    value: float
    cause: str
    rigorous: bool

    @property
    def sentence(self) -> str:
        """The bound in words."""
        unit = " rad/s" if self.bound in (Bound.WC_BELOW, Bound.WC_ABOVE) else ""
        whose = "any linear controller" if self.rigorous else "even an ideal controller"
        return f"{self.cause}: {self.bound.value} {self.value:.4g}{unit} with {whose}."


def performance_limits(process: Process) -> tuple[Limit, ...]:
    """Collect the bounds that dead time and right half-plane poles and zeros set [1]_.

    With A(s) = e^(-theta s) prod (z - s)/(z' + s) the ideal loop has T = A, and |L| = 1 where
    |1 - A| = 1: where A has turned by 60°, at 1.05/theta or at 0.58 z. With B(s) = prod
    (s - p)/(s + p') it has S = B, and crosses over at 1.73 p. Rigorous for every stabilising
    controller: |S| >= prod |z + p|/|z - p| at some frequency for each zero z, and
    |T| >= e^(p theta) prod |z + p|/|z - p| for each pole p.

    Parameters
    ----------
    process : Process
        Process model.

    Returns
    -------
    tuple of Limit
        Bounds; none for a stable process without dead time and right half-plane zeros.

    References
    ----------
    .. [1] S. Skogestad, I. Postlethwaite, "Multivariable Feedback Control", 2nd ed., chapter 5
       (from memory; the ideal crossovers are computed here, its rounded values are 1/theta, z/2
       and 2 p).
    """
    loop = _open(process)
    zeros, poles = _right(loop.zeros), _right(loop.poles)
    found = []
    if process.theta or zeros.size:
        w = _turned(zeros, process.theta)
        found.append(
            Limit(bound=Bound.WC_BELOW, value=w, cause=_slow_cause(process, zeros), rigorous=False)
        )
    if poles.size:
        # arg B is minus the lag of A with its frequencies turned about.
        w = 1 / _turned(1 / poles.conj(), 0.0)
        cause = f"Unstable {_listed('pole', poles)}"
        found.append(Limit(bound=Bound.WC_ABOVE, value=w, cause=cause, rigorous=False))
        peak = max(
            math.exp(min(pole.real * process.theta, 700.0)) * _blaschke(pole, zeros)
            for pole in poles
        )
        if peak > 1:
            cause = f"{cause} together with {_slow_cause(process, zeros, lower=True)}"
            found.append(Limit(bound=Bound.MT, value=peak, cause=cause, rigorous=True))
        if zeros.size:
            peak = max(_blaschke(zero, poles) for zero in zeros)
            cause = f"Unstable {_listed('pole', poles)} with {_zeros_in_words(zeros)}"
            found.append(Limit(bound=Bound.MS, value=peak, cause=cause, rigorous=True))
    return tuple(found)


def _open(process: Process) -> FactoredLoop:
    """Factor the process alone, turned in sign where it takes the direct action."""
    return FactoredLoop.of(process, PID(Kc=1.0, action=feedback_action(process)))


def _right(roots: Complex) -> Complex:
    return roots[roots.real > ON_THE_AXIS * np.abs(roots)]


def _blaschke(point: complex, roots: Complex) -> float:
    """Product of |root' + point|/|root - point|."""
    gaps = np.maximum(np.abs(roots - point), 1e-300)
    return float(np.prod(np.abs(roots.conj() + point) / gaps))


def _turned(zeros: Complex, theta: float) -> float:
    """First frequency at which e^(-theta s) prod (z - s)/(z' + s) has turned by 60°. [rad/s]"""

    def lag(w: Real) -> Real:
        turned = theta * w
        for z in zeros:
            turned = turned + np.arctan2(w - z.imag, z.real) + np.arctan2(w + z.imag, z.real)
        return np.asarray(turned - IDEAL_TURN)

    corners = [abs(z) for z in zeros] + ([1 / theta] if theta else [])
    w = np.geomspace(min(corners) * 1e-4, max(corners) * 1e4, POINTS)
    at = np.flatnonzero(lag(w) >= 0)[:1]
    return float(solve_brackets(lag, w[at - 1], w[at])[0])


def _slow_cause(process: Process, zeros: Complex, *, lower: bool = False) -> str:
    words = []
    if process.theta:
        words.append(f"{'dead' if lower else 'Dead'} time of {process.theta:.4g} s")
    if zeros.size:
        said = _zeros_in_words(zeros)
        words.append(said if words or lower else said.capitalize())
    return " and ".join(words)


def _zeros_in_words(zeros: Complex) -> str:
    return f"right half-plane {_listed('zero', zeros)}"


def _listed(noun: str, roots: Complex) -> str:
    shown = [f"{r.real:.4g}" if r.imag == 0 else f"{r:.4g}" for r in roots if r.imag >= 0]
    return f"{noun} at {', '.join(shown)} rad/s"


def largest_lead(structure: str, N: float = DEFAULT_N) -> float:
    """Largest phase lead of a controller over all settings; its lag has no such bound. [°]

    A derivative (1 + Td s (1 + 1/N))/(1 + Td s/N) leads by at most asin(N/(N + 2)), and an
    integral only takes away from that.

    Parameters
    ----------
    structure : str
        P, PI, PD or PID.
    N : float
        Derivative filter ratio, infinite for no filter. [-]
    """
    if structure not in ("P", "PI", "PD", "PID"):
        raise ValueError(f"the structure must be P, PI, PD or PID, got {structure}")
    if not N > 0:
        raise ValueError(f"N must be positive, got {N}")
    if "D" not in structure:
        return 0.0
    return math.degrees(math.asin(1 / (1 + 2 / N)))


def fastest_crossover(
    process: Process, phase: float, *, structure: str = "PID", N: float = DEFAULT_N
) -> float:
    """Highest gain crossover that any controller of a structure can have with a phase margin.

    arg G(jw) + largest lead = -180° + phase margin

    Parameters
    ----------
    process : Process
        Process model.
    phase : float
        Phase margin wanted, within 0 and 180. [°]
    structure : str
        P, PI, PD or PID.
    N : float
        Derivative filter ratio. [-]

    Returns
    -------
    float
        Crossover; infinite where phase sets no bound, 0 where no crossover has that margin.
        [rad/s]
    """
    if not 0 < phase < 180:
        raise ValueError(f"the phase margin must lie within 0° and 180°, got {phase}")
    loop = _open(process)
    lead = math.radians(largest_lead(structure, N))
    level = -math.pi + math.radians(phase) - lead
    roots = np.abs(np.concatenate([loop.poles, loop.zeros]))
    corners = [*roots[roots > 0].tolist(), *([1 / loop.theta] if loop.theta else [])] or [1.0]
    w = np.geomspace(min(corners) * 1e-5, max(corners) * 1e5, 2 * POINTS)

    def spare(v: Real) -> Real:
        return np.asarray(loop.phase(v) - level)

    enough = np.flatnonzero(spare(w) >= 0)
    if not enough.size:
        return 0.0
    last = enough[-1:]
    if last[0] == w.size - 1:
        return math.inf
    return float(solve_brackets(spare, w[last], w[last + 1])[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Feasibility:
    """Whether a speed can be had at all.

    Attributes
    ----------
    possible : bool
        Nothing here forbids it; that settings exist is for a tuning to show.
    reasons : tuple of str
        What forbids it, or how far away the bounds are.
    """

    possible: bool
    reasons: tuple[str, ...]


def crossover_feasibility(
    process: Process,
    wc: float,
    *,
    phase: float = 45.0,
    Ms: float = 2.0,
    structure: str = "PID",
    N: float = DEFAULT_N,
) -> Feasibility:
    """Say whether a gain crossover can be had with margins, and if not, why not.

    Parameters
    ----------
    process : Process
        Process model.
    wc : float
        Gain crossover wanted. [rad/s]
    phase : float
        Least phase margin. [°]
    Ms : float
        Largest peak of |S|; |T| then stays below Ms + 1. [-]
    structure : str
        P, PI, PD or PID.
    N : float
        Derivative filter ratio. [-]
    """
    if not (wc > 0 and math.isfinite(wc)):
        raise ValueError(f"the crossover must be positive, got {wc}")
    if not Ms > 1:
        raise ValueError(f"Ms must be above 1, got {Ms}")
    against: list[str] = []
    beside: list[str] = []
    own = fastest_crossover(process, phase, structure=structure, N=N)
    said = (
        f"With a phase margin of {phase:.4g}° the phase of the process allows a {structure} a "
        f"crossover of at most {own:.4g} rad/s, asked for {wc:.4g} rad/s."
    )
    (against if wc > own else beside).append(said)
    for limit in performance_limits(process):
        broken = {
            Bound.WC_BELOW: wc > limit.value,
            Bound.WC_ABOVE: wc < limit.value,
            Bound.MS: limit.value > Ms,
            Bound.MT: limit.value > Ms + 1,
        }[limit.bound]
        (against if broken else beside).append(limit.sentence)
    return Feasibility(possible=not against, reasons=tuple(against or beside))
