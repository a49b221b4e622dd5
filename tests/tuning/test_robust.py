"""The smallest tau_c that passes: printed values, invariance and the sides of the limit."""

import pytest

from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT, SOPDT, Process
from tuning.catalogue import RULES
from tuning.profiles import PROFILES, Profile
from tuning.robust import robust_tau_c
from tuning.verification import verify

SIMC, GENERAL = RULES["simc"], PROFILES["general"]


@pytest.mark.parametrize(
    ("profile", "ratio", "printed"),
    [
        ("general", 2.0, 1.14),
        ("general", 1.0, 1.14),
        ("general", 0.5, 1.14),
        ("general", 0.25, 1.43),
        ("general", 0.1, 1.68),
        ("general", 0.05, 1.83),
        ("general", 0.02, 1.95),
        ("process", 1.0, 2.02),
        ("process", 0.5, 2.18),
        ("process", 0.25, 2.60),
        ("process", 0.1, 2.86),
        ("process", 0.02, 3.2),
    ],
)
def test_simc_passes_from_the_printed_speed_on(profile: str, ratio: float, printed: float) -> None:
    """Printed from scans in steps of .01 to .02: the exact speed is up to a step less."""
    found = robust_tau_c(FOPDT(K=1.0, tau=1.0, theta=ratio), SIMC, "PI", PROFILES[profile])
    assert printed - 0.02 < found.tau_c / ratio < printed + 0.005


def test_for_tiny_dead_times_simc_needs_at_most_2_05_dead_times() -> None:
    for ratio in (0.01, 0.003, 0.0005):
        found = robust_tau_c(FOPDT(K=1.0, tau=1.0, theta=ratio), SIMC, "PI", GENERAL)
        assert 1.95 < found.tau_c / ratio < 2.055


@pytest.mark.parametrize(
    ("process", "rule", "structure", "profile"),
    [
        (FOPDT(K=-2.0, tau=120.0, theta=30.0), "simc", "PI", "general"),
        (FOPDT(K=2.0, tau=120.0, theta=30.0), "lambda_pi", "PI", "process"),
        (FOPDT(K=2.0, tau=120.0, theta=30.0), "imc_pi", "PI", "general"),
        (FOPDT(K=2.0, tau=30.0, theta=30.0), "imc_pid", "PID", "general"),
        (FOPDT(K=2.0, tau=30.0, theta=30.0), "isimc", "PID", "servo"),
        (IPDT(K=0.5, theta=3.0), "simc", "PI", "process"),
        (SOPDT(K=0.5, tau1=20.0, tau2=5.0, theta=3.0), "simc", "PID", "general"),
    ],
)
def test_the_answer_passes_and_a_little_faster_fails(
    process: Process, rule: str, structure: str, profile: str
) -> None:
    """Second route: the verification itself on both sides of the answer, to the promised .03 %."""
    target = PROFILES[profile]
    found = robust_tau_c(process, RULES[rule], structure, target)
    tune = RULES[rule].structures[structure]
    assert found.verification.passes
    assert found.pid == tune(process, found.tau_c)
    assert verify(process, found.pid, target).passes
    assert not verify(process, tune(process, found.tau_c * (1 - 4e-4)), target).passes


def test_the_answer_scales_with_the_time_unit_and_ignores_the_gain() -> None:
    here = robust_tau_c(FOPDT(K=2.0, tau=10.0, theta=3.0), SIMC, "PI", GENERAL)
    there = robust_tau_c(FOPDT(K=-50.0, tau=600.0, theta=180.0), SIMC, "PI", GENERAL)
    assert there.tau_c == pytest.approx(60 * here.tau_c, rel=1e-6)


def test_a_slower_scan_needs_a_slower_loop() -> None:
    process = FOPDT(K=2.0, tau=10.0, theta=3.0)
    fast = robust_tau_c(process, SIMC, "PI", GENERAL)
    slow = robust_tau_c(process, SIMC, "PI", GENERAL, sample_time=2.0)
    assert slow.tau_c > fast.tau_c


def test_a_profile_that_asks_little_is_answered_at_the_floor_of_the_search() -> None:
    """Lambda at .05 theta has GM (pi/2) 1.05: 1.10 with K or theta x 1.5, above the 1.01 asked."""
    process = FOPDT(K=2.0, tau=10.0, theta=30.0)
    easy = Profile(name="easy", gain=1.01, phase=0.1, Ms=500.0)
    found = robust_tau_c(process, RULES["lambda_pi"], "PI", easy)
    assert found.tau_c == pytest.approx(0.05 * 30.0)


def test_a_profile_that_nothing_can_pass_is_refused_with_the_closest() -> None:
    """Without dead time L = (4 x j + 1)/(-4 x^2): at most 76.4° of phase, however slow."""
    strict = Profile(name="strict", gain=2.0, phase=80.0, Ms=2.0)
    with pytest.raises(
        RuleNotApplicable,
        match=r"no tau_c from .* passes the strict profile; at the closest, .* the phase margin is",
    ):
        robust_tau_c(IPDT(K=0.5, theta=3.0), SIMC, "PI", strict)


def test_a_first_look_that_sees_too_little_is_corrected_by_the_whole_sweep(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    process = FOPDT(K=2.0, tau=10.0, theta=3.0)
    usual = robust_tau_c(process, SIMC, "PI", GENERAL)
    monkeypatch.setattr("tuning.robust.FIRST_LOOK", (1.0,))
    assert robust_tau_c(process, SIMC, "PI", GENERAL).tau_c == pytest.approx(usual.tau_c, rel=1e-6)


def test_speeds_beyond_every_controller_are_left_out_of_the_search() -> None:
    """K = 1e8: Kc reaches its smallest value within the range of the search."""
    found = robust_tau_c(FOPDT(K=1e8, tau=1.0, theta=0.5), SIMC, "PI", GENERAL)
    usual = robust_tau_c(FOPDT(K=1.0, tau=1.0, theta=0.5), SIMC, "PI", GENERAL)
    assert found.tau_c == pytest.approx(usual.tau_c, rel=1e-6)

    with pytest.raises(RuleNotApplicable, match=r"at no tau_c .* Kc must lie within"):
        robust_tau_c(FOPDT(K=5e8, tau=1.0, theta=50.0), SIMC, "PI", GENERAL)


def test_without_dead_time_there_is_no_smallest_speed() -> None:
    with pytest.raises(RuleNotApplicable, match="nothing in the model bounds the speed"):
        robust_tau_c(FOPDT(K=1.0, tau=1.0, theta=0.0), SIMC, "PI", GENERAL)


def test_only_a_rule_and_structure_with_a_speed_can_be_asked() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=0.2)
    with pytest.raises(ValueError, match="cohen_coon has no tau_c"):
        robust_tau_c(process, RULES["cohen_coon"], "PI", GENERAL)
    with pytest.raises(ValueError, match="simc has PI, PID, not PD"):
        robust_tau_c(process, SIMC, "PD", GENERAL)
    with pytest.raises(RuleNotApplicable, match="Td is the second lag"):
        robust_tau_c(process, SIMC, "PID", GENERAL)
