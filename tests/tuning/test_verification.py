"""Verification: what is swept, what decides, and what is said about it."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable, UnstableLoop
from loop.margins import margins
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, TransferFunction
from tuning.profiles import PROFILES, Profile
from tuning.simc import simc_pi, simc_pid
from tuning.sweep import FACTORS, sweep_of
from tuning.verification import verify, verify_many

GENERAL = PROFILES["general"]
HEATER = FOPDT(K=2.0, tau=120.0, theta=30.0)


def scaled(process: Process, **factors: float) -> Process:
    """The same process with some parameters multiplied."""
    match process:
        case TransferFunction():
            (n,), (d2, d1, _) = process.numerator, process.denominator
            K, tau2 = n / d1 * factors.get("K", 1), d2 / d1 * factors.get("tau2", 1)
            return TransferFunction((K,), (tau2, 1.0, 0.0), process.theta * factors.get("theta", 1))
        case SOPDT():
            lags = sorted(getattr(process, n) * factors.get(n, 1) for n in ("tau1", "tau2"))
            return SOPDT(
                K=process.K * factors.get("K", 1),
                tau1=lags[1],
                tau2=lags[0],
                theta=process.theta * factors.get("theta", 1),
            )
        case FOPDT():
            return FOPDT(
                K=process.K * factors.get("K", 1),
                tau=process.tau * factors.get("tau", 1),
                theta=process.theta * factors.get("theta", 1),
            )
        case _:
            return type(process)(
                K=process.K * factors.get("K", 1), theta=process.theta * factors.get("theta", 1)
            )


@pytest.mark.parametrize(
    ("process", "parameters"),
    [
        (HEATER, ("K", "tau", "theta")),
        (SOPDT(K=-1.0, tau1=20.0, tau2=2.0, theta=1.0), ("K", "tau1", "tau2", "theta")),
        (IPDT(K=0.5, theta=2.0), ("K", "theta")),
        (DoubleIntegrator(K=0.5, theta=2.0), ("K", "theta")),
        (TransferFunction((-2.0,), (3.0, 2.0, 0.0), 0.5), ("K", "tau2", "theta")),
        (FOPDT(K=2.0, tau=120.0, theta=0.0), ("K", "tau")),
    ],
)
def test_every_plant_of_the_sweep_is_the_scaled_model(
    process: Process, parameters: tuple[str, ...]
) -> None:
    """Second route: the scalar margins of each scaled model, one by one."""
    if isinstance(process, FOPDT | IPDT):
        pid = simc_pi(process, tau_c=2 * max(process.theta, 10.0))
    else:
        pid = simc_pid(process, tau_c=2 * process.theta)
    found = verify(process, pid, GENERAL)
    assert found.parameters == parameters

    def expect(where: dict[str, float], names: tuple[str, ...], values: list[float]) -> None:
        try:
            one = margins(scaled(process, **where), pid)
        except UnstableLoop:
            assert values == [0.0, 0.0, 0.0, math.inf]
        else:
            assert [getattr(one, n) for n in names] == pytest.approx(values, rel=1e-6)

    names = ("gain", "phase", "delay", "Ms")
    expect({}, names, [getattr(found.nominal, n) for n in names])
    for i, name in enumerate(parameters):
        for j in (0, 3, 10):
            values = [float(getattr(found.sweep, n)[i, j]) for n in names]
            expect({name: found.factors[j]}, names, values)
    for corner in (0, len(found.corner_factors) - 1):
        where = dict(zip(parameters, found.corner_factors[corner], strict=True))
        expect(where, names, [float(getattr(found.corners, n)[corner]) for n in names])


def test_the_sweep_takes_eleven_factors_and_all_corners() -> None:
    assert FACTORS == (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5)
    sweep = sweep_of(HEATER)
    assert sweep.plants.shape == (1 + 3 * 11 + 8,)
    assert {tuple(row) for row in sweep.factors[-8:]} == {
        (a, b, c) for a in (0.5, 1.5) for b in (0.5, 1.5) for c in (0.5, 1.5)
    }


def test_plants_are_named_by_what_is_off() -> None:
    sweep = sweep_of(HEATER)
    assert sweep.where[0] == "at the model"
    assert sweep.where[1] == "with K x 0.5"
    assert sweep.where[33] == "with theta x 1.5"
    assert sweep.where[34] == "with K x 0.5, tau x 0.5, theta x 0.5"
    assert sweep.moved[0] == (None, 1.0)
    assert sweep.moved[33] == ("theta", 1.5)
    assert sweep.moved[34] == (None, 1.0)


def test_a_failure_names_the_target_the_number_and_the_place() -> None:
    found = verify(HEATER, simc_pi(HEATER), GENERAL)
    assert found.nominal_passes
    assert not found.passes
    assert found.failure is not None
    assert (found.failure.target, found.failure.parameter, found.failure.factor) == (
        "Ms",
        "tau",
        0.6,
    )
    assert found.failure.value == pytest.approx(2.121, abs=5e-4)
    assert found.verdict == (
        "Fails the general profile: Ms is 2.121 with tau x 0.6, above 2; "
        "at worst Ms is 2.492 with tau x 0.5, above 2."
    )


def test_an_unstable_loop_is_said_to_be_unstable_and_has_no_margins() -> None:
    found = verify(HEATER, PID(Kc=4.0, Ti=100.0), GENERAL)
    assert not found.stable
    assert not found.nominal_passes
    assert (found.nominal.gain, found.nominal.phase, found.nominal.Ms) == (0.0, 0.0, math.inf)
    assert found.failure is not None
    assert found.failure.target == "stable"
    assert found.verdict == "Fails the general profile: the loop is unstable at the model."


def test_a_wrong_action_is_unstable_everywhere() -> None:
    found = verify(HEATER, PID(Kc=0.5, Ti=120.0, action=Action.DIRECT), GENERAL)
    assert not found.stable
    assert not found.sweep.stable.any()
    assert not found.corners.stable.any()


def test_instability_far_from_the_model_is_the_gravest_but_not_the_first() -> None:
    found = verify(HEATER, PID(Kc=1.9, Ti=90.0), PROFILES["servo"])
    assert found.failure is not None
    assert found.gravest is not None
    assert found.gravest.target == "stable"
    assert found.gravest.overrun == math.inf
    assert found.failure.target != "stable"
    assert "at worst the loop is unstable with" in found.verdict


def test_a_pass_tells_its_worst_cases() -> None:
    found = verify(HEATER, simc_pi(HEATER, tau_c=60.0), GENERAL)
    assert found.passes
    assert found.missed == ""
    assert found.failure is None
    assert found.gravest is None
    assert found.worst["Ms"].value == pytest.approx(1.697, abs=5e-4)
    assert "Ms 1.7 with tau x 0.5" in found.verdict
    assert found.verdict.startswith("Passes the general profile for ±50 % of each parameter")


@pytest.mark.parametrize(
    ("limits", "target"),
    [
        ({"gain": 50.0}, "gain"),
        ({"phase": 100.0}, "phase"),
        ({"Ms": 1.01}, "Ms"),
        ({"Mt": 1.5}, None),
        ({"delay_over_theta": 20.0}, "delay"),
        ({"delay_over_theta": 1.5}, None),
    ],
)
def test_each_limit_can_be_the_one_that_fails(limits: dict[str, float], target: str | None) -> None:
    profile = Profile(**({"name": "mine", "gain": 1.5, "phase": 20.0, "Ms": 3.0} | limits))
    found = verify(HEATER, simc_pi(HEATER, tau_c=120.0), profile)
    assert (found.failure.target if found.failure else None) == target


def test_a_peak_of_the_complementary_sensitivity_can_gate() -> None:
    profile = Profile(name="mine", gain=1.5, phase=20.0, Ms=3.0, Mt=1.05)
    found = verify(IPDT(K=1.0, theta=1.0), simc_pi(IPDT(K=1.0, theta=1.0)), profile)
    assert found.failure is not None
    assert found.failure.target == "Mt"
    assert "Mt is" in found.failure.sentence


def test_a_delay_margin_is_held_to_the_dead_time_of_its_own_plant() -> None:
    """SIMC at tau_c = theta has 2.142 theta at the model, less where theta alone is larger."""
    at_model = Profile(name="mine", gain=1.1, phase=1.0, Ms=50.0, delay_over_theta=2.1)
    found = verify(HEATER, simc_pi(HEATER), at_model)
    assert found.nominal_passes
    assert found.failure is not None
    assert found.failure.target == "delay"
    assert found.failure.sentence.endswith(" s")


def test_without_dead_time_a_delay_margin_asks_for_nothing() -> None:
    process = FOPDT(K=2.0, tau=120.0, theta=0.0)
    profile = Profile(name="mine", gain=2.0, phase=45.0, Ms=2.0, delay_over_theta=1.5)
    found = verify(process, simc_pi(process, tau_c=60.0), profile)
    assert found.passes
    assert "gain margin infinite at the model" in found.verdict
    assert found.verdict.endswith("The dead time is 0 and was not moved.")
    strict = Profile(name="mine", gain=2.0, phase=100.0, Ms=2.0, delay_over_theta=1.5)
    found = verify(process, simc_pi(process, tau_c=60.0), strict)
    assert found.failure is not None
    assert found.failure.target == "phase"


def test_a_number_that_rounds_to_its_limit_is_printed_further() -> None:
    at = verify(HEATER, simc_pi(HEATER, tau_c=60.0), GENERAL).worst["Ms"].value
    profile = Profile(name="mine", gain=1.5, phase=20.0, Ms=at * (1 - 1e-7))
    found = verify(HEATER, simc_pi(HEATER, tau_c=60.0), profile)
    assert found.failure is not None
    assert f"{found.failure.value:.4g}" == f"{found.failure.limit:.4g}"
    shown = re.search(r"Ms is ([\d.]+) with .*, above ([\d.]+)", found.failure.sentence)
    assert shown is not None
    assert float(shown[1]) > float(shown[2])


def test_the_scan_time_counts_as_half_of_it_in_dead_time() -> None:
    slow = verify(HEATER, simc_pi(HEATER, tau_c=60.0), GENERAL, sample_time=20.0)
    equivalent = margins(FOPDT(K=2.0, tau=120.0, theta=40.0), simc_pi(HEATER, tau_c=60.0))
    assert slow.nominal.Ms == pytest.approx(equivalent.Ms, rel=1e-6)
    assert (
        slow.worst["Ms"].value
        > verify(HEATER, simc_pi(HEATER, tau_c=60.0), GENERAL).worst["Ms"].value
    )


def test_many_controllers_at_once_are_each_as_alone() -> None:
    controllers = [simc_pi(HEATER, tau_c=x) for x in (10.0, 30.0, 90.0)]
    together = verify_many(HEATER, controllers, GENERAL)
    for one, pid in zip(together, controllers, strict=True):
        alone = verify(HEATER, pid, GENERAL)
        assert one.verdict == alone.verdict
        np.testing.assert_allclose(one.sweep.Ms, alone.sweep.Ms, rtol=1e-9)
    assert verify_many(HEATER, [], GENERAL) == ()


def test_another_transfer_function_is_refused() -> None:
    with pytest.raises(RuleNotApplicable, match="verification"):
        verify(TransferFunction((1.0,), (1.0, 2.0, 1.0)), PID(Kc=1.0), GENERAL)


def test_a_model_at_the_limit_of_models_is_refused_in_words() -> None:
    with pytest.raises(ValueError, match="leaves the range of models: K must"):
        verify(FOPDT(K=1e-9, tau=1.0, theta=1.0), PID(Kc=1.0), GENERAL)


@settings(max_examples=10, deadline=None)
@given(ratio=st.floats(0.05, 2.0), unit=st.sampled_from([1 / 60, 60.0]), span=st.floats(0.01, 100))
def test_the_verdict_does_not_depend_on_units(ratio: float, unit: float, span: float) -> None:
    here = FOPDT(K=2.0, tau=10.0, theta=10.0 * ratio)
    there = FOPDT(K=-2.0 * span, tau=10.0 * unit, theta=10.0 * ratio * unit)
    a, b = verify(here, simc_pi(here), GENERAL), verify(there, simc_pi(there), GENERAL)
    assert a.passes == b.passes
    for name in ("gain", "phase", "Ms", "Mt"):
        assert b.worst[name].value == pytest.approx(a.worst[name].value, rel=1e-6)
    assert b.worst["delay"].value == pytest.approx(a.worst["delay"].value * unit, rel=1e-6)
