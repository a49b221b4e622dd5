"""A cascade from two models: both controllers, what both loops keep, and what a single loop does.

The command line, the REST service and a notebook all call this:

    from advice.cascade import cascade_case
    case = cascade_case(FOPDT(K=3, tau=5, theta=1), FOPDT(K=0.8, tau=100, theta=10))
"""

from dataclasses import asdict, dataclass, replace

import numpy as np

from advice.body import Body, number, process_body, profile_body, settings_body
from advice.case_body import verification_body
from advice.display import digits, margins_words, settings_words
from advice.horizon import horizon
from advice.response_sweep_body import response_sweep_body
from loop.controller import PID
from loop.errors import LoopDiverged
from loop.experiment import Experiment
from loop.half_rule import half_rule
from loop.interacting import simulate_cascade
from loop.measures import LoadMeasures, load_measures
from loop.process import FOPDT, SOPDT
from loop.simulation import simulate
from tuning.cascade import Cascade, cascade, sweep_cascade
from tuning.profiles import DEFAULT_PROFILE, Profile, profile_named
from tuning.response_sweep import ResponseSweep, SweepVerdict, judge_sweep
from tuning.robust import robust_tau_c
from tuning.robust_cascade import robust_cascade
from tuning.simc import RULE, simc_pi
from tuning.verification import Verification, verify

# Scans within the inner closed-loop time constant; and no more scans than two seconds of work.
FINE, MOST_SCANS = 8.0, 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadAnswer:
    """What a unit load step at the input of the inner process does to the outer PV.

    Attributes
    ----------
    cascade, single : LoadMeasures
        With the cascade, and with one PI from OP to the outer PV. [PV], [s]
    """

    cascade: LoadMeasures
    single: LoadMeasures


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CascadeCase:
    """A cascade with what it keeps, beside the single loop in its place.

    Attributes
    ----------
    inner, outer : FOPDT
        Processes from OP to the inner PV, and from there to the outer PV.
    found : Cascade
        Both controllers, margins and speeds.
    profile : Profile
        Limits they were held to.
    inner_verification : Verification
        What the inner loop keeps for ±50 % of each of its parameters.
    sweep : ResponseSweep
        What the outer loop keeps for ±50 % of each parameter of either process.
    verdict : SweepVerdict
        Whether the outer loop keeps the profile.
    inner_tau_c, outer_tau_c : float
        Closed-loop time constants of both loops. [s]
    single : PID
        SIMC PI from OP to the outer PV, by the half rule.
    load : LoadAnswer or None
        A load on the inner process, with and without the cascade; None where the time scales lie
        too far apart to simulate.
    """

    inner: FOPDT
    outer: FOPDT
    found: Cascade
    profile: Profile
    inner_verification: Verification
    sweep: ResponseSweep
    verdict: SweepVerdict
    inner_tau_c: float
    outer_tau_c: float
    single: PID
    load: LoadAnswer | None


def cascade_case(
    inner: FOPDT,
    outer: FOPDT,
    *,
    inner_tau_c: float | None = None,
    outer_tau_c: float | None = None,
    profile: str = DEFAULT_PROFILE,
) -> CascadeCase:
    """Tune a cascade from inside out, sweep both loops and hold it against a single loop.

    Parameters
    ----------
    inner : FOPDT
        From OP to the inner PV.
    outer : FOPDT
        From the inner PV to the outer PV.
    inner_tau_c, outer_tau_c : float, optional
        Closed-loop time constants; the smallest with which the loops keep the profile for ±50 %
        of each parameter if not given. [s]
    profile : str
        Name of the profile to hold both loops to.

    Raises
    ------
    RuleNotApplicable
        The inner loop is less than three times as fast as the outer, or has no dead time and no
        time constant was chosen, or nothing keeps the profile.
    UnstableLoop
        The times asked for give an unstable loop.
    ValueError
        A number cannot be.
    """
    limits = profile_named(profile)
    if outer_tau_c is None:
        robust = robust_cascade(inner, outer, limits, inner_tau_c=inner_tau_c)
        found, sweep, verdict = robust.found, robust.sweep, robust.verdict
        speeds = (robust.inner_tau_c, robust.outer_tau_c)
    else:
        speed = inner_tau_c or robust_tau_c(inner, RULE, "PI", limits).tau_c
        found = cascade(inner, outer, inner_tau_c=speed, outer_tau_c=outer_tau_c)
        sweep = sweep_cascade(found, inner, outer)
        verdict, speeds = judge_sweep(sweep, limits), (speed, outer_tau_c)
    whole = SOPDT(
        K=inner.K * outer.K,
        tau1=max(inner.tau, outer.tau),
        tau2=min(inner.tau, outer.tau),
        theta=inner.theta + outer.theta,
    )
    single = simc_pi(half_rule(whole).model)
    return CascadeCase(
        inner=inner,
        outer=outer,
        found=found,
        profile=limits,
        inner_verification=verify(inner, found.inner, limits),
        sweep=sweep,
        verdict=verdict,
        inner_tau_c=speeds[0],
        outer_tau_c=speeds[1],
        single=single,
        load=_load(inner, outer, whole, found, single),
    )


def _load(
    inner: FOPDT, outer: FOPDT, whole: SOPDT, found: Cascade, single: PID
) -> LoadAnswer | None:
    t_end, _ = horizon(whole, [single])
    t_end = max(t_end, 12 * found.outer.Ti)
    lead = [inner.theta, 1 / (abs(inner.K) * found.inner.Kc / inner.tau)]
    dt = min(value for value in lead if value) / FINE
    scans = int(np.ceil(t_end / dt))
    if scans > MOST_SCANS or inner.theta / dt > MOST_SCANS or outer.theta / dt > MOST_SCANS:
        return None
    experiment = Experiment(t_end=scans * dt, dt=dt)
    try:
        run = simulate_cascade(
            outer, inner, found.outer, found.inner,
            outer=experiment, inner=replace(experiment, load=1.0),
        ).outer  # fmt: skip
        alone = simulate(whole, single, t_end=scans * dt, dt=dt, load=1.0)
    except LoopDiverged:
        return None
    return LoadAnswer(
        cascade=load_measures(run.t, run.pv, run.op, sp=0.0, op_before=0.0),
        single=load_measures(alone.t, alone.pv, alone.op, sp=0.0, op_before=0.0),
    )


def cascade_body(case: CascadeCase) -> Body:
    """A cascade as the JSON document of command line and API."""
    found = case.found
    return {
        "inner": {
            "process": process_body(case.inner),
            "tau_c": case.inner_tau_c,
            "settings": settings_body(found.inner),
            **verification_body(case.inner_verification),
        },
        "outer": {
            "process": process_body(case.outer),
            "seen": process_body(found.seen),
            "tau_c": case.outer_tau_c,
            "settings": settings_body(found.outer),
            **response_sweep_body(case.sweep, case.verdict),
        },
        "profile": profile_body(case.profile),
        "speed_ratio": found.speed_ratio,
        "fast_enough": found.fast_enough,
        "single_loop": {"settings": settings_body(case.single)},
        "inner_load": None
        if case.load is None
        else {
            "cascade": _measures_body(case.load.cascade),
            "single_loop": _measures_body(case.load.single),
        },
        "sentences": list(cascade_sentences(case)),
    }


def _measures_body(measures: LoadMeasures) -> Body:
    return {name: number(value) for name, value in asdict(measures).items()}


def cascade_sentences(case: CascadeCase) -> list[str]:
    """A cascade in words."""
    found = case.found
    sentences = [
        f"Inner controller, tau_c = {digits(case.inner_tau_c, 3)} s: "
        f"{settings_words(found.inner)}, {found.inner.action.value} action; "
        f"{margins_words(found.inner_margins)}.",
        f"Inner loop: {case.inner_verification.verdict}",
        f"Outer controller, tau_c = {digits(case.outer_tau_c, 3)} s, its output the set point of "
        "the inner: "
        f"{settings_words(found.outer)}, {found.outer.action.value} action; "
        f"{margins_words(found.outer_margins)}.",
        f"Outer loop: {case.verdict.sentence}",
        found.sentence,
    ]
    if case.load is not None:
        with_it, without = case.load.cascade, case.load.single
        part = abs(with_it.peak_deviation / without.peak_deviation)
        sentences.append(
            f"A unit load at the inner process moves the outer PV by "
            f"{digits(abs(with_it.peak_deviation), 3)}, with one PI in place of both "
            f"({settings_words(case.single)}) by {digits(abs(without.peak_deviation), 3)}: "
            f"{100 * part:.3g} % is left."
        )
    return sentences
