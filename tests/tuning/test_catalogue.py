"""House rules and invariances over the whole catalogue."""

import inspect
import math
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loop.controller import PID, Action
from loop.errors import RuleNotApplicable
from loop.process import (
    FOPDT,
    IPDT,
    SOPDT,
    DoubleIntegrator,
    Process,
    PureDelay,
    TransferFunction,
)
from tuning.catalogue import RULES
from tuning.rule import Rule

COLUMNS = [(rule, structure) for rule in RULES.values() for structure in rule.structures]
IDS = [f"{rule.name}-{structure}" for rule, structure in COLUMNS]


def process_of(kind: str, K: float, tau: float, theta: float) -> Process:
    """Build a process of the named type; K in PV/OP, times in s."""
    match kind:
        case "FOPDT":
            return FOPDT(K=K, tau=tau, theta=theta)
        case "SOPDT":
            return SOPDT(K=K, tau1=tau, tau2=tau / 5, theta=theta)
        case "IPDT":
            return IPDT(K=K / tau, theta=theta)
        case "PureDelay":
            return PureDelay(K=K, theta=theta)
        case "DoubleIntegrator":
            return DoubleIntegrator(K=K / tau**2, theta=theta)
        case _:
            return TransferFunction((K,), (tau * tau / 5, tau, 0.0), theta)


def taken(rule: Rule, structure: str, *numbers: float) -> list[Process]:
    """One process of each type the structure takes."""
    return [process_of(kind, *numbers) for kind in rule.takes[structure]]


def settings_or_none(rule: Rule, structure: str, process: Process) -> PID | None:
    """Settings, or None where the rule refuses."""
    try:
        return rule.structures[structure](process)
    except RuleNotApplicable:
        return None


@pytest.mark.parametrize(("rule", "structure"), COLUMNS, ids=IDS)
def test_every_rule_names_its_source_aim_range_and_units(rule: Rule, structure: str) -> None:
    tune = rule.structures[structure]
    module = inspect.getmodule(tune)
    assert module is not None
    told, own = " ".join((module.__doc__ or "").split()), tune.__doc__ or ""
    words = [rule.source.split()[0], *re.findall(r"\b(?:19|20)\d\d\b", rule.source)]
    assert all(word in told for word in words)
    assert "Source:" in told
    assert re.search(r"originals? (was|were) not read", told)
    assert "[s]" in own
    assert "Examples" in own or rule.name == "simc"  # simc_pid only passes on
    assert rule.aim
    assert rule.validity


def test_the_catalogue_is_keyed_by_name_and_cannot_be_changed() -> None:
    assert all(rule.name == name for name, rule in RULES.items())
    with pytest.raises(TypeError):
        RULES["mine"] = RULES["simc"]  # type: ignore[index]
    with pytest.raises(TypeError):
        RULES["simc"].structures["P"] = RULES["simc"].structures["PI"]  # type: ignore[index]


def test_structures_and_takes_name_the_same_columns() -> None:
    for rule in RULES.values():
        assert list(rule.structures) == list(rule.takes)
        assert (rule.default_tau_c is None) == (rule.tau_c_text is None)


@pytest.mark.parametrize(("rule", "structure"), COLUMNS, ids=IDS)
@settings(max_examples=15, deadline=None)
@given(
    ratio=st.floats(0.01, 2.5),
    unit=st.sampled_from([1e-3, 1 / 60, 60.0]),
    span=st.sampled_from([0.01, 100.0, 1e3]),
)
def test_no_rule_depends_on_the_choice_of_units(
    rule: Rule, structure: str, ratio: float, unit: float, span: float
) -> None:
    """The time unit changes only times, the PV span only gains, the sign only the action."""
    pairs = zip(
        taken(rule, structure, 2.0, 12.0, 12.0 * ratio),
        taken(rule, structure, 2.0 * span, 12.0 * unit, 12.0 * ratio * unit),
        taken(rule, structure, -2.0, 12.0, 12.0 * ratio),
        strict=True,
    )
    for here, there, mirrored in pairs:
        found = [settings_or_none(rule, structure, p) for p in (here, there, mirrored)]
        if None in found:  # a range in theta/tau knows no units either
            assert rule.name.startswith(("usort", "amigo_frequency"))
            assert found == [None, None, None]
            continue
        a, b, c = (pid for pid in found if pid is not None)
        assert b.Kc * span == pytest.approx(a.Kc)
        assert (b.Ti, b.Td, b.tauF) == pytest.approx((a.Ti * unit, a.Td * unit, a.tauF * unit))
        assert (b.N, b.b, b.c) == pytest.approx((a.N, a.b, a.c))
        assert (a.action, b.action, c.action) == (Action.REVERSE, Action.REVERSE, Action.DIRECT)
        assert (c.Kc, c.Ti, c.Td) == pytest.approx((a.Kc, a.Ti, a.Td))
        assert a.structure == structure


@pytest.mark.parametrize(("rule", "structure"), COLUMNS, ids=IDS)
def test_the_rule_takes_exactly_the_process_types_it_names(rule: Rule, structure: str) -> None:
    for kind in (
        "FOPDT",
        "SOPDT",
        "IPDT",
        "DoubleIntegrator",
        "PureDelay",
        "TransferFunction",
    ):
        process = process_of(kind, 2.0, 10.0, 5.0)
        if kind in rule.takes[structure]:
            assert isinstance(rule.structures[structure](process), PID)
            rule.notes(structure, process, 1.0)
        else:
            with pytest.raises(RuleNotApplicable):
                rule.structures[structure](process)


@pytest.mark.parametrize(("rule", "structure"), COLUMNS, ids=IDS)
def test_without_dead_time_a_rule_refuses_or_needs_none(rule: Rule, structure: str) -> None:
    kinds = [kind for kind in rule.takes[structure] if kind != "PureDelay"]
    for process in [process_of(kind, 2.0, 10.0, 0.0) for kind in kinds]:
        if rule.name == "lambda_pi":
            assert rule.structures[structure](process).Kc == pytest.approx(0.5)
            continue
        with pytest.raises(RuleNotApplicable, match="dead time"):
            rule.structures[structure](process)


@pytest.mark.parametrize(("rule", "structure"), COLUMNS, ids=IDS)
def test_a_chosen_speed_is_used_or_refused_never_ignored(rule: Rule, structure: str) -> None:
    process = taken(rule, structure, 2.0, 10.0, 2.0)[0]
    tune = rule.structures[structure]
    if not rule.uses_tau_c:
        with pytest.raises(ValueError, match="no tau_c"):
            tune(process, 3.0)
        return
    assert tune(process, 3.0).Kc > tune(process, 30.0).Kc
    for impossible in (0.0, -3.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="tau_c"):
            tune(process, impossible)


def test_a_chosen_speed_serves_a_process_without_dead_time() -> None:
    for name in ("simc", "isimc", "imc_pi", "imc_improved_pi", "lambda_pi"):
        pid = RULES[name].structures["PI"](FOPDT(K=2.0, tau=10.0, theta=0.0), 5.0)
        assert pid.Kc == pytest.approx(1.0)
    for name in ("isimc", "imc_pid", "imc_pid_with_lag"):
        with pytest.raises(RuleNotApplicable, match="Td is 0"):
            RULES[name].structures["PID"](FOPDT(K=2.0, tau=10.0, theta=0.0), 5.0)


def test_cohen_coon_pd_ends_where_its_derivative_time_does() -> None:
    assert RULES["cohen_coon"].structures["PD"](FOPDT(K=1, tau=1, theta=2.99)).Td > 0
    with pytest.raises(RuleNotApplicable, match="below 3"):
        RULES["cohen_coon"].structures["PD"](FOPDT(K=1, tau=1, theta=3.0))


def test_simc_pid_refuses_other_transfer_functions() -> None:
    for other in (TransferFunction((1,), (1, 1)), TransferFunction((1,), (-1, 1, 0))):
        with pytest.raises(RuleNotApplicable, match="is not K"):
            RULES["simc"].structures["PID"](other)


@pytest.mark.parametrize(
    ("name", "structure", "ratio", "tau_c", "words"),
    [
        ("ziegler_nichols_reaction_curve", "PI", 1.5, None, "outside the range"),
        ("ziegler_nichols_reaction_curve", "PI", 0.05, None, "below the usual"),
        ("ziegler_nichols_ultimate", "PI", 0.5, None, "exact"),
        ("tyreus_luyben", "PI", 2.0, None, "slow recovery"),
        ("cohen_coon", "PI", 2.0, None, "0.1 to 0.5"),
        ("imc_pi", "PI", 0.5, 8.0, "outside the range"),
        ("imc_pid", "PID", 0.5, 3.0, "outside the range"),
        ("imc_pid_with_lag", "PID", 0.5, 8.0, "without it"),
        ("simc", "PI", 0.5, 4.0, "faster than recommended"),
        ("isimc", "PID", 0.5, 5.0, "series"),
        ("amigo", "PID", 0.5, None, "memory"),
        ("amigo", "PID", 0.1, None, "below 0.3"),
    ],
)
def test_what_to_know_about_the_settings_is_said(
    name: str, structure: str, ratio: float, tau_c: float | None, words: str
) -> None:
    process = FOPDT(K=1.0, tau=10.0, theta=10.0 * ratio)
    assert any(words in note for note in RULES[name].notes(structure, process, tau_c))


@pytest.mark.parametrize(
    ("name", "structure", "tau_c"),
    [
        ("ziegler_nichols_reaction_curve", "PI", None),
        ("cohen_coon", "PID", None),
        ("imc_pi", "PI", 8.5),
        ("imc_pid", "PID", 4.0),
        ("simc", "PI", 5.0),
        ("amigo", "PI", None),
        ("lambda_pi", "PI", 15.0),
    ],
)
def test_nothing_is_said_where_there_is_nothing_to_say(
    name: str, structure: str, tau_c: float | None
) -> None:
    assert RULES[name].notes(structure, FOPDT(K=1.0, tau=10.0, theta=5.0), tau_c) == ()
    if name == "ziegler_nichols_reaction_curve":
        assert RULES[name].notes(structure, IPDT(K=1.0, theta=5.0), tau_c) == ()
