"""The whole answer: every rule once, verified, with a recommendation that can be relied on."""

import pytest

from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, TransferFunction
from tuning.answer import tunings
from tuning.profiles import PROFILES
from tuning.proposals import tune_all
from tuning.verification import verify

GENERAL = PROFILES["general"]
HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def test_every_rule_answers_and_simc_again_at_the_speed_that_passes() -> None:
    found = tunings(HEATER, GENERAL)
    published = tune_all(HEATER)
    assert tuple(t.proposal for t in found.tunings[:-1]) == published
    extra = found.tunings[-1].proposal
    assert (extra.rule, extra.structure) == ("simc", "PI")
    assert extra.tau_c == pytest.approx(1.43 * 30, abs=0.005 * 30)
    assert extra.tau_c_reason == "smallest that passes the general profile"
    assert all((t.verification is None) == (t.proposal.pid is None) for t in found.tunings)


@pytest.mark.parametrize("name", ["general", "process", "hvac"])
@pytest.mark.parametrize(
    "process",
    [
        HEATER,
        FOPDT(K=-0.3, tau=5.0, theta=20.0),
        FOPDT(K=1.0, tau=100.0, theta=0.5),
        IPDT(K=0.5, theta=3.0),
        SOPDT(K=0.5, tau1=20.0, tau2=5.0, theta=3.0),
        TransferFunction((1.0,), (2.0, 1.0, 0.0), 0.5),
    ],
    ids=["heater", "dead time", "lag", "integrator", "two lags", "integrator with lag"],
)
def test_what_is_recommended_passes_the_profile(process: Process, name: str) -> None:
    """Second route: the settings alone through the verification."""
    profile = PROFILES[name]
    found = tunings(process, profile)
    assert found.recommendation.reason
    if found.recommendation.index is None:
        assert not any(
            t.verification.passes
            for t in found.tunings
            if t.verification and t.proposal.structure in ("PI", "PID")
        )
        return
    best = found.tunings[found.recommendation.index].proposal
    assert best.pid is not None
    assert verify(process, best.pid, profile).passes


def test_first_order_processes_always_get_a_recommendation() -> None:
    for name, ratio in (("hvac", 0.01), ("aerospace", 0.2), ("servo", 1.0), ("disk_drive", 5.0)):
        found = tunings(FOPDT(K=1.0, tau=10.0, theta=10.0 * ratio), PROFILES[name])
        assert found.recommendation.index is not None


def test_no_slower_simc_is_added_where_its_own_speed_passes() -> None:
    found = tunings(HEATER, GENERAL, tau_c=60.0)
    assert len(found.tunings) == len(tune_all(HEATER))


def test_the_filter_of_a_double_integrator_cannot_pass_and_that_is_told() -> None:
    """A conditionally stable loop: half the gain or twice the time costs its phase."""
    process = DoubleIntegrator(K=1.0, theta=1.0)
    found = tunings(process, PROFILES["process"])
    assert found.recommendation.index is None
    assert found.tunings[-1].proposal.rule == "simc"
    assert "no tau_c from" in (found.tunings[-1].proposal.refusal or "")


def test_without_dead_time_lambda_answers() -> None:
    found = tunings(FOPDT(K=2.0, tau=120.0, theta=0.0), GENERAL)
    assert found.recommendation.index is not None
    best = found.tunings[found.recommendation.index].proposal
    assert best.rule == "lambda_pi"


def test_the_scan_time_is_part_of_every_margin() -> None:
    slow, fast = tunings(HEATER, GENERAL, sample_time=30.0), tunings(HEATER, GENERAL)
    for a, b in zip(slow.tunings, fast.tunings, strict=True):
        if a.verification and b.verification and a.proposal.pid == b.proposal.pid:
            assert a.verification.nominal.delay <= b.verification.nominal.delay
