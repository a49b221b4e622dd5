"""The fastest Smith predictor that keeps a profile while its model is wrong."""

from dataclasses import dataclass

from loop.errors import RuleNotApplicable
from loop.process import FOPDT
from tuning.profiles import Profile
from tuning.response_sweep import ResponseSweep, SweepVerdict, judge_sweep
from tuning.smith_predictor import SmithPredictor, smith_predictor, sweep_smith
from tuning.sweep import FACTORS

# At .4 dead times an error of half the dead time leaves Ms 4.3 (docs); beyond 20 all is calm.
FASTEST, SLOWEST, GROWTH = 0.5, 20.0, 2**0.5
HALVINGS = 5
TITLE = "A Smith predictor"


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustSmith:
    """The fastest Smith predictor that keeps a profile over ±50 % of each parameter.

    Attributes
    ----------
    predictor : SmithPredictor
        Predictor, with its tau_c to 1 %.
    sweep : ResponseSweep
        What it keeps.
    verdict : SweepVerdict
        It passes.
    """

    predictor: SmithPredictor
    sweep: ResponseSweep
    verdict: SweepVerdict


def robust_smith(model: FOPDT, profile: Profile) -> RobustSmith:
    """Find the smallest tau_c at which a Smith predictor keeps a profile under model errors.

    From .5 to 20 dead times, first with both ends of each parameter and then with all eleven
    factors: the answer passes the whole sweep.

    Parameters
    ----------
    model : FOPDT
        Process model with dead time.
    profile : Profile
        Limits on the margins.

    Raises
    ------
    RuleNotApplicable
        There is no dead time, or no tau_c of the range passes.
    """
    ends = (FACTORS[0], FACTORS[-1])

    def tried(tau_c: float, factors: tuple[float, ...] = ends) -> RobustSmith:
        predictor = smith_predictor(model, tau_c)
        sweep = sweep_smith(predictor, factors=factors)
        return RobustSmith(predictor=predictor, sweep=sweep, verdict=judge_sweep(sweep, profile))

    theta = model.theta or 1.0  # without dead time the first predictor refuses
    slow, fast = FASTEST * theta, 0.0
    while not (last := tried(slow)).verdict.passes:
        if slow * GROWTH > SLOWEST * theta:
            raise RuleNotApplicable(
                TITLE,
                f"no tau_c up to {slow:.4g} s, {slow / theta:.3g} dead times, keeps the profile "
                f"{profile.name} under ±50 % of each parameter; there {last.verdict.missed}",
            )
        fast, slow = slow, slow * GROWTH
    for _ in range(HALVINGS if fast else 0):
        middle = (fast * slow) ** 0.5
        fast, slow = (fast, middle) if tried(middle).verdict.passes else (middle, slow)
    while not (found := tried(slow, FACTORS)).verdict.passes:  # an error between the ends is worse
        slow *= 1.02
    return found
