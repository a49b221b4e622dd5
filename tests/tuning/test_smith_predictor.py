import math
from dataclasses import replace

import numpy as np
import pytest

from loop.controller import PID, controller_response
from loop.errors import RuleNotApplicable, UnstableLoop
from loop.margins import margins
from loop.process import FOPDT
from loop.response_margins import ResponseLoop, following_grid, response_margins
from loop.signals import Complex
from tuning.lambda_pi import lambda_pi
from tuning.profiles import PROFILES, Profile
from tuning.response_sweep import judge_sweep
from tuning.robust_smith import robust_smith
from tuning.smith_predictor import smith_margins, smith_predictor, sweep_smith

MODEL = FOPDT(K=1, tau=1, theta=1)


def test_the_sweep_of_theta_equal_tau_is_that_of_the_anchor() -> None:
    found = sweep_smith(smith_predictor(MODEL, 0.5))
    Ms = {name: [kept.Ms for kept in row] for name, row in found.swept.items()}

    assert found.nominal.Ms == pytest.approx(1.68, abs=0.005)
    assert max(Ms["theta"]) == pytest.approx(2.4, abs=0.05)
    assert Ms["K"][-1] == pytest.approx(2.5, abs=0.05)
    assert Ms["tau"][0] == pytest.approx(2.9, abs=0.05)
    assert (found.worst_Ms, found.worst) == (max(Ms["tau"]), "tau x 0.5")
    assert all(row[5] == found.nominal for row in found.swept.values())


def test_at_the_model_the_sensitivity_is_one_minus_the_delayed_lag() -> None:
    w = np.linspace(1e-3, 60, 200_000)
    S = np.abs(1 - np.exp(-1j * w) / (1 + 0.5j * w))

    assert smith_margins(smith_predictor(MODEL, 0.5), MODEL).Ms == pytest.approx(S.max(), rel=1e-6)
    # The unit of time and of PV, and the sign of the gain, change nothing.
    other = FOPDT(K=-40, tau=60, theta=60)
    same = smith_margins(smith_predictor(other, 30), other)
    assert same.Ms == pytest.approx(S.max(), rel=1e-6)
    assert same.delay == pytest.approx(
        60 * smith_margins(smith_predictor(MODEL, 0.5), MODEL).delay, rel=1e-9
    )


@pytest.mark.parametrize("factor", [0.5, 0.9, 1.1, 1.5])
def test_stability_is_what_a_simulation_by_small_steps_shows(factor: float) -> None:
    # A predictor asked for too much is lost to an error of its dead time, first one way round.
    fast = smith_predictor(MODEL, 0.1)
    process = FOPDT(K=1, tau=1, theta=factor)
    h, steps = 0.002, 20_000
    y, ym, integral = 0.0, 0.0, 0.0
    past = np.zeros(steps)
    late, model_late = round(factor / h), round(1 / h)
    ym_past, error = np.zeros(steps), np.zeros(steps)
    for k in range(steps):
        ym_past[k] = ym
        delayed = ym_past[k - model_late] if k >= model_late else 0.0
        error[k] = 1 - y
        e = 1 - (y - delayed + ym)
        integral += h * e
        past[k] = fast.pid.Kc * (e + integral / fast.pid.Ti)
        ym += h * (past[k] - ym)
        y += h * ((past[k - late] if k >= late else 0.0) - y)
        if abs(y) > 1e6:
            break
    settles = abs(error[k]) < 1.0 and np.max(np.abs(error[k - 2000 : k])) < 1.0

    try:
        smith_margins(fast, process)
        stable = True
    except UnstableLoop:
        stable = False
    assert stable == settles


def test_an_error_that_loses_the_loop_counts_as_no_margin_at_all() -> None:
    found = sweep_smith(smith_predictor(MODEL, 0.1))

    lost = [kept for row in found.swept.values() for kept in row if kept.Ms == math.inf]
    assert lost
    assert lost[0].gain == 0.0
    assert found.worst_Ms == math.inf


def test_what_has_no_predictor_is_refused() -> None:
    with pytest.raises(RuleNotApplicable, match="there is no dead time to predict over"):
        smith_predictor(FOPDT(K=1, tau=1, theta=0), 0.5)
    with pytest.raises(ValueError, match="tau_c must be positive, got 0"):
        smith_predictor(MODEL, 0)


def test_margins_from_a_response_are_those_from_its_factors() -> None:
    heater = FOPDT(K=2, tau=120, theta=30)
    for pid in (
        PID(Kc=0.45, Ti=135, Td=13.3),
        PID(Kc=1.2, Ti=60),
        PID(Kc=2.0, Ti=135, Td=13.3, tauF=4),
    ):

        def opened(s: Complex, pid: PID = pid) -> Complex:
            return np.asarray(controller_response(pid, s) * 2 * np.exp(-30 * s) / (120 * s + 1))

        w = following_grid([1 / 120, 1 / 30, 0.75], 20.0, 30.0)
        found = response_margins(ResponseLoop(L=opened, w=w))
        exact = margins(heater, pid)
        for name in ("gain", "phase", "delay", "Ms", "Mt"):
            assert getattr(found, name) == pytest.approx(getattr(exact, name), rel=1e-6), name
        assert found.gain_reduction == exact.gain_reduction

    def lost(s: Complex) -> Complex:
        return np.asarray(5 * (1 + 1 / (135 * s)) * 2 * np.exp(-30 * s) / (120 * s + 1))

    with pytest.raises(UnstableLoop):
        response_margins(ResponseLoop(L=lost, w=following_grid([1 / 120, 1 / 30], 20.0, 30.0)))
    with pytest.raises(ValueError, match="too often to follow"):
        following_grid([1.0], 1e6, 30.0)


def test_a_loop_that_never_reaches_gain_one_has_no_phase_to_lose() -> None:
    found = response_margins(
        ResponseLoop(L=lambda s: 0.5 / (s + 1), w=following_grid([1.0], 100.0, 0.0), axis_poles=())
    )

    assert (found.gain, found.phase, found.delay) == (math.inf, math.inf, math.inf)
    assert found.Ms == pytest.approx(1.0, abs=1e-3)
    assert found.Mt == pytest.approx(1 / 3, abs=1e-6)


@pytest.mark.parametrize("profile", ["general", "process"])
def test_the_fastest_predictor_keeps_the_profile_and_a_faster_one_does_not(profile: str) -> None:
    limits = PROFILES[profile]
    found = robust_smith(FOPDT(K=-2, tau=30, theta=60), limits)
    tau_c = found.predictor.tau_c
    assert found.verdict.passes
    assert f"Passes the {profile} profile for ±50 % of each parameter" in found.verdict.sentence
    kept = [margin for row in found.sweep.swept.values() for margin in row]
    assert max(margin.Ms for margin in kept) <= limits.Ms
    assert min(margin.gain for margin in kept) >= limits.gain
    faster = sweep_smith(smith_predictor(found.predictor.model, 0.97 * tau_c), factors=(0.5, 1.5))
    assert not judge_sweep(faster, limits).passes


def test_a_predictor_that_no_speed_saves_is_refused() -> None:
    strict = Profile(name="strict", gain=30.0, phase=45, Ms=2)
    with pytest.raises(
        RuleNotApplicable, match=r"16 dead times, keeps the profile strict .* the gain margin is"
    ):
        robust_smith(FOPDT(K=1, tau=1, theta=1), strict)
    with pytest.raises(RuleNotApplicable, match="no dead time"):
        robust_smith(FOPDT(K=1, tau=1, theta=0), strict)


def test_a_sweep_says_what_is_lost_first() -> None:
    sweep = sweep_smith(smith_predictor(FOPDT(K=1, tau=1, theta=1), 0.25))
    assert sweep.worst_Ms == math.inf
    verdict = judge_sweep(sweep, Profile(name="none", gain=1.0001, phase=0.1, Ms=1e9))
    assert "the loop is unstable with" in verdict.sentence
    late = Profile(name="late", gain=1.1, phase=1, Ms=99, delay_over_theta=3.0, Mt=99)
    calm = sweep_smith(smith_predictor(FOPDT(K=1, tau=1, theta=1), 1.5))
    assert "the delay margin is" in judge_sweep(calm, late).sentence
    assert judge_sweep(calm, replace(late, delay_over_theta=1.0)).passes


def test_the_load_area_is_that_of_a_lambda_pi() -> None:
    """Second route: the predictor run sample by sample, and the PI's Ti/Kc."""
    model, dt = FOPDT(K=2, tau=30, theta=60), 0.5
    predictor = smith_predictor(model, 40.0)
    keep, late = math.exp(-dt / 30), 120
    sent = [0.0] * late
    plant = inner = delayed_inner = integral = area = 0.0
    for k in range(8000):
        delayed = sent[k]
        plant = keep * plant + 2 * (1 - keep) * (delayed + (1.0 if k >= late else 0.0))
        delayed_inner = keep * delayed_inner + 2 * (1 - keep) * delayed
        area += plant * dt
        # The model without its dead time, corrected by what the delayed one misses.
        error = -(plant + inner - delayed_inner)
        integral += predictor.pid.Kc / predictor.pid.Ti * error * dt
        u = predictor.pid.Kc * error + integral
        sent.append(u)
        inner = keep * inner + 2 * (1 - keep) * u
    assert area == pytest.approx(predictor.load_area, rel=5e-3)
    pi = lambda_pi(model, 40.0)
    assert predictor.load_area == pytest.approx(pi.Ti / pi.Kc)
