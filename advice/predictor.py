"""A Smith predictor from a model: settings, what they keep, and what a PI would keep instead.

The command line, the REST service and a notebook all call this:

    from advice.predictor import predictor_case
    case = predictor_case(FOPDT(K=2, tau=30, theta=60))
"""

from dataclasses import dataclass

from advice.body import Body, process_body, profile_body, settings_body
from advice.case_body import verification_body
from advice.display import digits, margins_words, settings_words
from advice.response_sweep_body import response_sweep_body
from loop.controller import PID
from loop.process import FOPDT
from tuning.lambda_pi import lambda_pi
from tuning.profiles import DEFAULT_PROFILE, Profile, profile_named
from tuning.response_sweep import ResponseSweep, SweepVerdict, judge_sweep
from tuning.robust_smith import robust_smith
from tuning.smith_predictor import SmithPredictor, smith_predictor, sweep_smith
from tuning.verification import Verification, verify


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PredictorCase:
    """A Smith predictor with what it keeps, beside the PI that does as much against loads.

    Attributes
    ----------
    predictor : SmithPredictor
        Settings, and the model to program.
    reason : str
        Where tau_c comes from.
    profile : Profile
        Limits it was held to.
    sweep : ResponseSweep
        Margins at the model and while each of its parameters is off by up to 50 %.
    verdict : SweepVerdict
        Whether the profile holds.
    pi : PID
        The lambda PI of the same tau_c, which leaves the same area of PV after a load step.
    pi_verification : Verification
        What that one keeps.
    """

    predictor: SmithPredictor
    reason: str
    profile: Profile
    sweep: ResponseSweep
    verdict: SweepVerdict
    pi: PID
    pi_verification: Verification


def predictor_case(
    process: FOPDT, *, tau_c: float | None = None, profile: str = DEFAULT_PROFILE
) -> PredictorCase:
    """Tune a Smith predictor and sweep the errors of its model.

    Parameters
    ----------
    process : FOPDT
        Process model with dead time.
    tau_c : float, optional
        Closed-loop time constant after the dead time; the smallest that keeps the profile with
        each parameter of the model off by up to 50 % if not given. [s]
    profile : str
        Name of the profile to hold it to.

    Raises
    ------
    RuleNotApplicable
        There is no dead time to predict over, or no tau_c keeps the profile.
    ValueError
        A number cannot be.
    """
    limits = profile_named(profile)
    if tau_c is None:
        found = robust_smith(process, limits)
        predictor, sweep, verdict = found.predictor, found.sweep, found.verdict
        reason = f"the smallest that keeps the profile {limits.name} for ±50 % of each parameter"
    else:
        predictor, reason = smith_predictor(process, tau_c), "as chosen"
        sweep = sweep_smith(predictor)
        verdict = judge_sweep(sweep, limits)
    pi = lambda_pi(process, predictor.tau_c)
    return PredictorCase(
        predictor=predictor,
        reason=reason,
        profile=limits,
        sweep=sweep,
        verdict=verdict,
        pi=pi,
        pi_verification=verify(process, pi, limits),
    )


def predictor_body(case: PredictorCase) -> Body:
    """A Smith predictor as the JSON document of command line and API."""
    return {
        "process": process_body(case.predictor.model),
        "profile": profile_body(case.profile),
        "tau_c": case.predictor.tau_c,
        "tau_c_reason": case.reason,
        "settings": settings_body(case.predictor.pid),
        "model": process_body(case.predictor.model),
        **response_sweep_body(case.sweep, case.verdict),
        "load_area": case.predictor.load_area,
        "pi_of_the_same_load_area": {
            "settings": settings_body(case.pi),
            **verification_body(case.pi_verification),
        },
        "sentences": list(predictor_sentences(case)),
    }


def predictor_sentences(case: PredictorCase) -> list[str]:
    """A Smith predictor in words."""
    model, pi = case.predictor.model, case.pi_verification
    worst = pi.worst["Ms"]
    return [
        f"PI on the model without its dead time: {settings_words(case.predictor.pid)} "
        f"(tau_c = {digits(case.predictor.tau_c, 3)} s, {case.reason}).",
        f"Model to program: K = {digits(model.K)}, tau = {digits(model.tau)} s, "
        f"theta = {digits(model.theta)} s.",
        f"At the model: {margins_words(case.sweep.nominal)}.",
        case.verdict.sentence,
        f"A unit load step leaves an area of PV of {digits(case.predictor.load_area)} s.",
        f"A PI with the same area ({settings_words(case.pi)}) has Ms "
        f"{digits(pi.nominal.Ms, 3)} at the model and {digits(worst.value, 3)} at worst, "
        f"{worst.where}; the predictor {digits(case.sweep.nominal.Ms, 3)} and "
        f"{digits(case.sweep.worst_Ms, 3)}, with {case.sweep.worst}.",
    ]
