"""The formulas of the rules against derivations, limits and printed examples.

The columns for first-order processes are held to a table in `test_rules_computed.py`.
"""

import math

import pytest

from loop.controller import PID, Action
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, PureDelay, TransferFunction
from tuning.catalogue import RULES
from tuning.imc import imc_improved_pi, imc_pid, imc_pid_with_lag
from tuning.lambda_pi import lambda_integrating_pi, lambda_pi
from tuning.series_form import series_to_isa
from tuning.simc import (
    simc_double_integrating_pid,
    simc_integrating_lag_pid,
    simc_pid,
    simc_second_order_pid,
)


def test_the_two_imc_pid_columns_keep_their_own_denominators() -> None:
    """The heater of the anchors: .500 without lag, .450 only with its 12 s lag."""
    heater = FOPDT(K=2.0, tau=120.0, theta=30.0)
    plain, lagged = imc_pid(heater, 120.0), imc_pid_with_lag(heater, 120.0)

    assert (plain.Kc, plain.tauF) == pytest.approx((0.500, 0.0))
    assert (lagged.Kc, lagged.tauF) == pytest.approx((0.450, 12.0))
    assert (plain.Ti, lagged.Ti) == (135.0, 135.0)
    assert plain.Td == pytest.approx(13.3, abs=0.05)
    assert lagged.Td == plain.Td


def test_imc_pid_is_the_pade_inverse_of_the_process() -> None:
    """With a first-order Padé dead time the plain PID leaves L = (2 - theta s)/(...s) exactly.

    Derived, not copied: G_pade C = (2 - theta s) / ((2 tau_c + theta) s).
    """
    K, tau, theta, tau_c = 2.0, 120.0, 30.0, 50.0
    pid = imc_pid(FOPDT(K=K, tau=tau, theta=theta), tau_c)
    for s in (0.01j, 0.1j, 0.003 + 0.02j):
        C = pid.Kc * (1 + 1 / (pid.Ti * s) + pid.Td * s)
        G = K / (tau * s + 1) * (1 - theta * s / 2) / (1 + theta * s / 2)
        assert pytest.approx((2 - theta * s) / ((2 * tau_c + theta) * s)) == G * C


def test_imc_pid_with_lag_leaves_a_first_order_closed_loop_times_the_dead_time() -> None:
    """Derived: with an all-pass Padé factor the closed loop is A(s)/(tau_c s + 1)."""
    K, tau, theta, tau_c = 2.0, 120.0, 30.0, 50.0
    pid = imc_pid_with_lag(FOPDT(K=K, tau=tau, theta=theta), tau_c)
    for s in (0.01j, 0.1j, 0.003 + 0.02j):
        C = pid.Kc * (1 + 1 / (pid.Ti * s) + pid.Td * s) / (pid.tauF * s + 1)
        all_pass = (1 - theta * s / 2) / (1 + theta * s / 2)
        L = K / (tau * s + 1) * all_pass * C
        assert pytest.approx(all_pass / (tau_c * s + 1)) == L / (1 + L)


def test_lambda_and_imc_pi_are_different_rules() -> None:
    motor = FOPDT(K=100.0, tau=0.05, theta=0.005)
    pid = lambda_pi(motor, 0.0125)
    assert pid.Kc == pytest.approx(0.02857, abs=5e-6)
    assert pid.Kc / pid.Ti == pytest.approx(0.5714, abs=5e-5)
    assert RULES["imc_pi"].structures["PI"](motor, 0.0125).Kc == pytest.approx(0.04)


def test_improved_pi_is_the_imc_pid_gain_without_the_derivative() -> None:
    pid = imc_improved_pi(FOPDT(K=2.0, tau=1.0, theta=1.0), 1.7)
    assert (pid.Kc, pid.Ti) == pytest.approx((3 / (4 * 1.7), 1.5))


def test_integrating_limits_are_those_of_the_first_order_formulas() -> None:
    """Second route: a first-order model with a huge tau and K = slope tau is an integrator."""
    tau = 1e7
    slow, integrator = FOPDT(K=0.5 * tau, tau=tau, theta=2.0), IPDT(K=0.5, theta=2.0)
    for name in (
        "simc",
        "amigo",
        "ziegler_nichols_reaction_curve",
        "ziegler_nichols_ultimate",
        "tyreus_luyben",
    ):
        for structure, types in RULES[name].takes.items():
            if "IPDT" in types:
                near = RULES[name].structures[structure](slow)
                limit = RULES[name].structures[structure](integrator)
                # AMIGO prints its integrating constants to two or three digits: 13.35 as 13.4.
                assert near.Kc == pytest.approx(limit.Kc, rel=5e-3), (name, structure)
                assert near.Ti == pytest.approx(limit.Ti, rel=5e-3), (name, structure)
                assert near.Td == pytest.approx(limit.Td, rel=5e-3), (name, structure)


def test_lambda_for_an_integrator_is_memory_and_asks_for_its_closed_loop() -> None:
    """Derived: without dead time the closed loop is (2 tau_c s + 1)/(tau_c s + 1)^2."""
    pid = lambda_integrating_pi(IPDT(K=0.5, theta=0.0), 3.0)
    for s in (0.1j, 1j, 0.2 + 0.3j):
        L = 0.5 / s * pid.Kc * (1 + 1 / (pid.Ti * s))
        assert pytest.approx((2 * 3 * s + 1) / (3 * s + 1) ** 2) == L / (1 + L)
    assert RULES["lambda_integrating_pi"].status == "memory"


# E10 and E6 of the SIMC examples (settings as printed there, series form), E8 as computed.
@pytest.mark.parametrize(
    ("process", "Kc", "Ti", "Td"),
    [
        pytest.param(SOPDT(K=1, tau1=20, tau2=2, theta=1), 10.0, 8, 2, id="E10"),
        pytest.param(SOPDT(K=1, tau1=1, tau2=1, theta=1), 0.5, 1, 1, id="E9"),
        pytest.param(SOPDT(K=1, tau1=6, tau2=3, theta=3), 1.0, 6, 3, id="E11"),
        pytest.param(
            TransferFunction((1,), (1.33, 1, 0), 0.358), 1.39665, 2.864, 1.33, id="E6 integrating"
        ),
        pytest.param(DoubleIntegrator(K=1, theta=1), 0.0625, 8, 8, id="double integrator"),
    ],
)
@pytest.mark.parametrize("alpha", [0.0, 0.01, 0.05])
def test_simc_pid_runs_as_the_printed_series_controller(
    process: SOPDT | TransferFunction | DoubleIntegrator,
    Kc: float,
    Ti: float,
    Td: float,
    alpha: float,
) -> None:
    """Second route: the ISA controller's response equals the series formula's, filter included."""
    match process:
        case DoubleIntegrator():
            pid = simc_double_integrating_pid(process, alpha=alpha)
        case TransferFunction():
            pid = simc_integrating_lag_pid(process, alpha=alpha)
        case SOPDT():
            pid = simc_second_order_pid(process, alpha=alpha)
    for s in (0.01j, 1j, 30j):
        series = Kc * (1 + 1 / (Ti * s)) * (Td * s + 1) / (alpha * Td * s + 1)
        isa = pid.Kc * (1 + 1 / (pid.Ti * s) + pid.Td * s / (1 + pid.Td * s / pid.N))
        assert isa == pytest.approx(series, rel=1e-5)


def test_simc_pid_takes_its_form_from_the_process() -> None:
    assert simc_pid(DoubleIntegrator(K=1, theta=1)) == simc_double_integrating_pid(
        DoubleIntegrator(K=1, theta=1)
    )
    two_lags = SOPDT(K=1, tau1=20, tau2=2, theta=1)
    assert simc_pid(two_lags) == simc_second_order_pid(two_lags)
    process = TransferFunction((-2.0,), (1.0, 4.0, 0.0), 0.5)
    assert simc_pid(process) == simc_integrating_lag_pid(process)
    assert simc_pid(process).action is Action.DIRECT


def test_amigo_constants_are_those_of_2004() -> None:
    """13, 12, 7; the older 6.7, 2, 10 would give a Ti of .876 at theta/tau = .25, not .820."""
    pid = RULES["amigo"].structures["PI"](FOPDT(K=1, tau=1, theta=0.25))
    assert pid.Ti == pytest.approx(0.35 * 0.25 + 13 * 0.25 / (1 + 12 * 0.25 + 7 * 0.25**2))
    assert pid.Ti == pytest.approx(0.820, abs=5e-4)


@pytest.mark.parametrize(("theta", "b"), [(0.5, 0.0), (1.0, 0.0), (1.01, 1.0), (4.0, 1.0)])
def test_amigo_weights_the_set_point_by_the_relative_dead_time(theta: float, b: float) -> None:
    assert RULES["amigo"].structures["PID"](FOPDT(K=1, tau=1, theta=theta)).b == b


@pytest.mark.parametrize(
    ("name", "structure", "theta", "tau_c"),
    [
        ("simc", "PI", 3.0, 3.0),
        ("isimc", "PI", 3.0, 3.0),
        ("isimc", "PID", 3.0, 3.0),
        ("lambda_pi", "PI", 3.0, 10.0),
        ("lambda_pi", "PI", 5.0, 15.0),
        ("lambda_pi", "PI", 0.0, 10.0),
        ("imc_pi", "PI", 3.0, 5.1),
        ("imc_improved_pi", "PI", 3.0, 5.1),
        ("imc_pid", "PID", 3.0, 2.4),
        ("imc_pid_with_lag", "PID", 3.0, 2.4),
    ],
)
def test_the_default_speed_is_the_formula_it_names(
    name: str, structure: str, theta: float, tau_c: float
) -> None:
    process = FOPDT(K=2.0, tau=10.0, theta=theta)
    tune = RULES[name].structures[structure]
    unsaid, said = tune(process), tune(process, tau_c)
    assert (unsaid.Kc, unsaid.Ti, unsaid.Td) == pytest.approx((said.Kc, said.Ti, said.Td))
    default = RULES[name].default_tau_c
    assert default is not None
    assert default(process) == pytest.approx(tau_c)


def test_settings_of_a_negative_gain_take_the_direct_action() -> None:
    for rule in RULES.values():
        for structure, types in rule.takes.items():
            process = {
                "FOPDT": FOPDT(K=-2.0, tau=10.0, theta=5.0),
                "IPDT": IPDT(K=-0.5, theta=3.0),
                "PureDelay": PureDelay(K=-2.0, theta=3.0),
                "SOPDT": SOPDT(K=-2.0, tau1=10.0, tau2=1.0, theta=3.0),
            }[types[0]]
            pid = rule.structures[structure](process)
            assert pid.action is Action.DIRECT
            assert 0 < pid.Kc < math.inf
            assert isinstance(pid, PID)


@pytest.mark.parametrize("ratio", [0.01, 0.3, 1.0, 3.0, 100.0])
def test_series_settings_keep_their_zeros_and_a_usual_filter_whichever_time_is_longer(
    ratio: float,
) -> None:
    """Second route: the product of the printed series factors with the filter in its place."""
    pid = series_to_isa(Kc=0.5, Ti=2.0, Td=2.0 * ratio, alpha=0.05, K=-1.0)
    assert 9 <= pid.N <= 19
    assert pid.action is Action.DIRECT
    Tf = 0.05 * min(2.0, 2.0 * ratio)
    for s in (0.01j, 1j, 30j):
        series = 0.5 * (1 + 1 / (2.0 * s)) * (2.0 * ratio * s + 1) / (Tf * s + 1)
        isa = pid.Kc * (1 + 1 / (pid.Ti * s) + pid.Td * s / (1 + pid.Td * s / pid.N))
        assert isa == pytest.approx(series, rel=1e-9)
