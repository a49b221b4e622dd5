"""Rules published as tables of constants: CHR, kappa-tau, uSORT, AMIGO from the ultimate point."""

import math

import pytest

from loop.controller import PID
from loop.errors import RuleNotApplicable, UnstableLoop
from loop.margins import margins
from loop.process import FOPDT, IPDT, SOPDT
from tuning.catalogue import RULES
from tuning.ultimate import ultimate_point


def plant(ratio: float) -> FOPDT:
    """Process with K = tau = 1 and the given theta/tau."""
    return FOPDT(K=1.0, tau=1.0, theta=ratio)


def settings(name: str, structure: str, ratio: float) -> PID:
    """What a rule answers for it."""
    return RULES[name].structures[structure](plant(ratio))


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("chr_setpoint_0", 0.3),
        ("chr_load_0", 0.3),
        ("chr_setpoint_20", 0.7),
        ("chr_load_20", 0.7),
    ],
)
def test_chr_p_is_a_part_of_the_reaction_curve_gain(name: str, factor: float) -> None:
    """Second route: Ziegler and Nichols take the same tau/(K theta) times 1."""
    whole = settings("ziegler_nichols_reaction_curve", "P", 0.4).Kc
    assert settings(name, "P", 0.4).Kc == pytest.approx(factor * whole)


def test_chr_set_point_columns_agree_with_the_public_excerpt_to_its_rounding() -> None:
    """The excerpt has .95, 1.357 tau, .473 theta and .6, tau, .5 theta."""
    wide, flat = settings("chr_setpoint_20", "PID", 0.5), settings("chr_setpoint_0", "PID", 0.5)
    assert (wide.Kc * 0.5, wide.Ti) == pytest.approx((0.95, 1.357), abs=0.05)
    assert wide.Td / 0.5 == pytest.approx(0.473, abs=0.005)
    assert (flat.Kc * 0.5, flat.Ti, flat.Td / 0.5) == pytest.approx((0.6, 1.0, 0.5))


# At t = 1/2 each curve is a0 exp(a1/2 + a2/4); the exponents are added up by hand.
@pytest.mark.parametrize(
    ("name", "structure", "Kc", "Ti", "Td", "b"),
    [
        ("kappa_tau_14", "PI", (0.29, -0.425), (8.9, -2.55), None, (1.0, 0.0)),
        ("kappa_tau_20", "PI", (0.78, -0.625), (8.9, -2.55), None, (0.44, 0.2775)),
        ("kappa_tau_14", "PID", (3.8, -2.375), (5.2, -1.6), (0.89, -1.21), (0.4, 0.79)),
        ("kappa_tau_20", "PID", (8.4, -2.35), (3.2, -0.9825), (0.86, -1.06), (0.22, 0.31225)),
    ],
)
def test_kappa_tau_at_equal_lag_and_dead_time(
    name: str,
    structure: str,
    Kc: tuple[float, float],
    Ti: tuple[float, float],
    Td: tuple[float, float] | None,
    b: tuple[float, float],
) -> None:
    pid = settings(name, structure, 1.0)
    found = [pid.Kc, pid.Ti, pid.b] + ([pid.Td] if Td else [])
    expected = [a0 * math.exp(x) for a0, x in (Kc, Ti, b, *([Td] if Td else []))]
    assert found == pytest.approx(expected)
    assert (pid.Td > 0) == (structure == "PID")


def test_kappa_tau_pid_is_unsafe_on_a_first_order_process_and_says_so() -> None:
    pid = settings("kappa_tau_14", "PID", 0.25)
    ideal = PID(Kc=pid.Kc, Ti=pid.Ti, Td=pid.Td, N=math.inf)
    with pytest.raises(UnstableLoop):  # an unfiltered derivative keeps the gain above 1
        margins(plant(0.1), PID(Kc=6.0, Ti=1.0, Td=0.3, N=math.inf))
    assert margins(plant(0.25), ideal).Ms == pytest.approx(3.5, abs=0.05)
    assert margins(plant(0.25), pid).Ms == pytest.approx(4.3, abs=0.05)
    for name, ratio in (("kappa_tau_20", 0.25), ("kappa_tau_14", 0.1), ("kappa_tau_20", 0.1)):
        with pytest.raises(UnstableLoop):
            margins(plant(ratio), settings(name, "PID", ratio))
    for name in ("kappa_tau_14", "kappa_tau_20"):
        assert any("not safe" in note for note in RULES[name].notes("PID", plant(1.0), None))
        assert RULES[name].notes("PI", plant(1.0), None) == ()


@pytest.mark.parametrize(
    ("name", "structure", "Ms"),
    [
        ("usort_load_20", "PI", 2.0),
        ("usort_load_20", "PID", 2.0),
        ("usort_load_16", "PI", 1.6),
        ("usort_setpoint_18", "PI", 1.8),
        ("usort_setpoint_16", "PI", 1.6),
    ],
)
@pytest.mark.parametrize("ratio", [0.1, 0.2, 0.5, 1.0, 2.0])
def test_usort_reaches_the_sensitivity_it_was_made_for(
    name: str, structure: str, Ms: float, ratio: float
) -> None:
    """Second route: the margins, which the rows were verified by; within 0.05 as stated."""
    assert margins(plant(ratio), settings(name, structure, ratio)).Ms == pytest.approx(Ms, abs=0.05)


@pytest.mark.parametrize("ratio", [0.0999, 2.001])
def test_usort_refuses_where_its_rows_were_not_checked(ratio: float) -> None:
    with pytest.raises(RuleNotApplicable, match=r"theta/tau from 0.1 to 2"):
        settings("usort_load_20", "PI", ratio)


@pytest.mark.parametrize("ratio", [0.2, 0.5, 1.0, 2.0, 5.0])
def test_amigo_from_the_ultimate_point_keeps_its_sensitivity(ratio: float) -> None:
    point = ultimate_point(plant(ratio))
    assert 1 / point.Ku > 0.11
    assert 1.355 < margins(plant(ratio), settings("amigo_frequency", "PI", ratio)).Ms < 1.465
    if 1 / point.Ku > 0.2:
        assert 1.435 < margins(plant(ratio), settings("amigo_frequency", "PID", ratio)).Ms < 1.545


def test_amigo_from_the_ultimate_point_by_hand() -> None:
    """Ku = 1.90344 and Pu = 2 pi/3.67319 at theta/tau = 1/2, as the computed table has them."""
    pi, pid = settings("amigo_frequency", "PI", 0.5), settings("amigo_frequency", "PID", 0.5)
    Ku, Pu, ratio = 3.80688, 2 * math.pi / 3.6732, 1 / 3.80688
    assert pi.Kc == pytest.approx(0.16 * Ku, rel=1e-5)
    assert pi.Ti == pytest.approx(Pu / (1 + 4.5 * ratio), rel=5e-5)
    assert pid.Kc == pytest.approx((0.3 - 0.1 * ratio**4) * Ku, rel=1e-5)
    assert pid.Ti == pytest.approx(0.6 * Pu / (1 + 2 * ratio), rel=5e-5)
    assert pid.Td == pytest.approx(0.15 * (1 - ratio) * Pu / (1 - 0.95 * ratio), rel=5e-5)


def test_amigo_from_the_ultimate_point_says_where_it_was_not_checked() -> None:
    rule = RULES["amigo_frequency"]
    with pytest.raises(RuleNotApplicable, match=r"above 0.2, here it is 0.0612"):
        rule.structures["PID"](plant(0.1))
    integrator = IPDT(K=1.0, theta=1.0)
    found = margins(integrator, rule.structures["PI"](integrator))
    assert (found.Ms, found.Mt) == pytest.approx((1.76, 1.89), abs=0.005)
    assert any("was checked from 0.12 on" in note for note in rule.notes("PI", integrator, None))
    two_lags = SOPDT(K=1.0, tau1=1.0, tau2=1.0, theta=1.0)
    assert len(rule.notes("PI", two_lags, None)) == 1
