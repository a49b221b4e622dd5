"""Cascade: the inner loop first, then the outer on what the inner one makes of its process."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from loop.bracket_solver import solve_brackets
from loop.controller import PID, controller_response
from loop.errors import RuleNotApplicable, UnstableLoop
from loop.frequency_curves import bandwidths
from loop.margins import Margins, margins
from loop.process import FOPDT
from loop.response_margins import ResponseLoop, following_grid, response_margins
from loop.signals import Complex
from loop.stability import unstable_poles
from tuning.response_sweep import ResponseSweep, sweep_response
from tuning.simc import simc_pi
from tuning.sweep import FACTORS

# The inner loop should be ten times as fast; below five it is said, below three refused.
WANTED_RATIO, LEAST_RATIO = 5.0, 3.0
BEYOND = 200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Cascade:
    """Both controllers of a cascade, and what both loops keep.

    Attributes
    ----------
    inner, outer : PID
        Controllers; the outer's output is the inner's set point.
    seen : FOPDT
        What the outer controller was tuned on: its process behind the closed inner loop.
    inner_margins, outer_margins : Margins
        Margins, the outer ones on the true closed inner loop with both dead times.
    speed_ratio : float
        Crossover of the inner loop over that of the outer. [-]
    fast_enough : bool
        Whether the inner loop is at least five times as fast.
    sentence : str
        The answer in words.
    """

    inner: PID
    outer: PID
    seen: FOPDT
    inner_margins: Margins
    outer_margins: Margins
    speed_ratio: float
    fast_enough: bool
    sentence: str


def cascade(
    inner: FOPDT,
    outer: FOPDT,
    *,
    inner_tau_c: float | None = None,
    outer_tau_c: float | None = None,
) -> Cascade:
    """Tune a cascade from inside out by SIMC, and verify both loops exactly.

    The closed inner loop is e^(-theta2 s)/(tau_c2 s + 1) to the outer controller; by the half rule
    its process becomes tau = tau1 + tau_c2/2, theta = theta1 + theta2 + tau_c2/2. The outer
    margins are then taken on L1 = C1 G1 T2 with T2 = C2 G2/(1 + C2 G2), not on that model.

    Parameters
    ----------
    inner : FOPDT
        From OP to the inner PV.
    outer : FOPDT
        From the inner PV to the outer PV.
    inner_tau_c : float, optional
        Closed-loop time constant of the inner loop; its dead time if not given. [s]
    outer_tau_c : float, optional
        Closed-loop time constant of the outer loop; its dead time with the inner loop, and no
        less than five times the inner one's, if not given. [s]

    Raises
    ------
    RuleNotApplicable
        The inner loop comes out less than three times as fast as the outer: a cascade would
        fight itself, and a single loop does as well.
    UnstableLoop
        The times asked for give an unstable loop.
    """
    speed = inner.theta if inner_tau_c is None else inner_tau_c
    C2 = simc_pi(inner, inner_tau_c)
    seen = FOPDT(
        K=outer.K,
        tau=outer.tau + speed / 2,
        theta=outer.theta + inner.theta + speed / 2,
    )
    wanted = max(seen.theta, WANTED_RATIO * speed) if outer_tau_c is None else outer_tau_c
    C1 = simc_pi(seen, wanted)

    inner_margins = margins(inner, C2)
    loop = _outer_loop(inner, outer, C2, C1)
    outer_margins = response_margins(loop)
    ratio = _crossover(inner, C2) / _last_crossover(loop)
    if ratio < LEAST_RATIO:
        raise RuleNotApplicable(
            "A cascade",
            f"the inner loop is only {ratio:.3g} times as fast as the outer, of which at least "
            f"{LEAST_RATIO:g} are needed and 10 are good",
        )
    fast = ratio >= WANTED_RATIO
    sentence = (
        f"The inner loop is {ratio:.3g} times as fast as the outer: "
        + ("fast enough." if fast else "just enough; 10 times would be good.")
        + " Close the inner loop first."
    )
    return Cascade(
        inner=C2,
        outer=C1,
        seen=seen,
        inner_margins=inner_margins,
        outer_margins=outer_margins,
        speed_ratio=ratio,
        fast_enough=fast,
        sentence=sentence,
    )


def sweep_cascade(
    found: Cascade, inner: FOPDT, outer: FOPDT, *, factors: tuple[float, ...] = FACTORS
) -> ResponseSweep:
    """Move one parameter of either process at a time while both controllers stay.

    The margins are those of the outer loop on the true closed inner loop; where the inner loop is
    lost, so is the outer.

    Parameters
    ----------
    found : Cascade
        Both controllers.
    inner, outer : FOPDT
        Processes they were tuned on.
    factors : tuple of float
        Factors on the parameter; 0.5 to 1.5 in eleven steps if not given. [-]
    """

    def margins_of(parameters: Mapping[str, float]) -> Margins:
        within, around = (
            FOPDT(**{name: parameters[f"{place} {name}"] for name in ("K", "tau", "theta")})
            for place in ("inner", "outer")
        )
        lost = unstable_poles(within, found.inner)
        if lost:
            raise UnstableLoop(lost)
        return response_margins(_outer_loop(within, around, found.inner, found.outer))

    return sweep_response(
        margins_of,
        {
            f"{place} {name}": value
            for place, process in (("inner", inner), ("outer", outer))
            for name, value in asdict(process).items()
        },
        factors=factors,
    )


def _outer_loop(inner: FOPDT, outer: FOPDT, C2: PID, C1: PID) -> ResponseLoop:
    """Open outer loop C1 G1 C2 G2/(1 + C2 G2), followed up to where it is small."""

    def opened(s: Complex) -> Complex:
        L2 = controller_response(C2, s) * inner.K / (inner.tau * s + 1) * np.exp(-inner.theta * s)
        G1 = outer.K / (outer.tau * s + 1) * np.exp(-outer.theta * s)
        return np.asarray(controller_response(C1, s) * G1 * L2 / (1 + L2))

    # |C1 G1| falls as this over w and |T2| is about 2 at most: a hundred times beyond L is small.
    speed = C1.Kc * abs(outer.K) * max(1 / outer.tau, 1 / C1.Ti)
    fast = C2.Kc * abs(inner.K) * max(1 / inner.tau, 1 / C2.Ti)
    corners = [1 / inner.tau, 1 / outer.tau, fast, speed]
    w = following_grid(corners, BEYOND * speed, inner.theta + outer.theta)
    return ResponseLoop(L=opened, w=w)


def _crossover(process: FOPDT, pid: PID) -> float:
    return bandwidths(process, pid).wc or 0.0


def _last_crossover(loop: ResponseLoop) -> float:
    """Highest frequency of gain 1. [rad/s]"""
    opened, w = loop.L, loop.w
    i = int(np.flatnonzero(np.abs(opened(1j * w)) >= 1)[-1])
    return float(
        solve_brackets(lambda v: np.log(np.abs(opened(1j * v))), w[i : i + 1], w[i + 1 : i + 2])[0]
    )
