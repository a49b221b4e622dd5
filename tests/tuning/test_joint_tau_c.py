"""tau_c with all parameters off at once: printed range, both sides of the limit, refusals."""

import pytest

from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT, Process
from tuning.box_verdict import hold_box
from tuning.catalogue import RULES
from tuning.joint_tau_c import joint_tau_c
from tuning.profiles import PROFILES, Profile

GENERAL = PROFILES["general"]


@pytest.mark.parametrize("ratio", [2.0, 0.5, 0.1, 0.02])
def test_simc_needs_two_to_six_dead_times(ratio: float) -> None:
    """Printed: 2.3 to 5.75 dead times over theta/tau of .02 to 2."""
    found = joint_tau_c(FOPDT(K=1.0, tau=1.0, theta=ratio), RULES["simc"], "PI", GENERAL)
    assert 2.25 < found.tau_c / ratio < 5.85
    assert found.alone < found.tau_c


@pytest.mark.parametrize(
    ("process", "rule", "structure"),
    [
        (FOPDT(K=-2.0, tau=120.0, theta=30.0), "simc", "PI"),
        (FOPDT(K=2.0, tau=120.0, theta=30.0), "lambda_pi", "PI"),
        (IPDT(K=0.5, theta=3.0), "simc", "PI"),
    ],
)
def test_the_answer_is_proven_and_a_little_faster_is_not(
    process: Process, rule: str, structure: str
) -> None:
    found = joint_tau_c(process, RULES[rule], structure, GENERAL)
    assert found.verdict.holds is True
    faster = RULES[rule].structures[structure](process, found.tau_c * 0.985)
    assert hold_box(process, faster, GENERAL).holds is False


def test_what_no_speed_passes_is_refused() -> None:
    """One parameter at a time passes at last, all at once never within 200 dead times."""
    strict = Profile(name="strict", gain=2.0, phase=45.0, Ms=1.0005)
    with pytest.raises(RuleNotApplicable, match="no tau_c"):
        joint_tau_c(FOPDT(K=1.0, tau=1.0, theta=1.0), RULES["simc"], "PI", strict)
