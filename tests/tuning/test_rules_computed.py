"""Settings and margins of the rules: a table computed elsewhere, and the anchors of the rules.

Second route: `tests/reference/rules_computed.csv` was computed by other code. It prints settings
to five decimals and margins to four, so tolerances are half of the last digit.
"""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID, SeriesPID
from loop.margin_batch import MarginBatch, batch_margins
from loop.margins import margins
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator
from tuning.amigo import amigo_pi, amigo_pid
from tuning.catalogue import RULES
from tuning.isimc import isimc_pi, isimc_pid
from tuning.simc import simc_double_integrating_pid, simc_pi, simc_second_order_pid
from tuning.tyreus_luyben import tyreus_luyben_pi
from tuning.ultimate import ultimate_point

TABLE = Path(__file__).parents[1] / "reference" / "rules_computed.csv"

# Name in the table -> rule, structure and tau_c in units of (tau, theta); None where it has none.
COLUMNS: dict[str, tuple[str, str, tuple[float, float] | None]] = {
    "ZN-RC P": ("ziegler_nichols_reaction_curve", "P", None),
    "ZN-RC PI": ("ziegler_nichols_reaction_curve", "PI", None),
    "ZN-RC PID": ("ziegler_nichols_reaction_curve", "PID", None),
    "ZN-ult P": ("ziegler_nichols_ultimate", "P", None),
    "ZN-ult PI": ("ziegler_nichols_ultimate", "PI", None),
    "ZN-ult PID": ("ziegler_nichols_ultimate", "PID", None),
    "CC P": ("cohen_coon", "P", None),
    "CC PI": ("cohen_coon", "PI", None),
    "CC PD": ("cohen_coon", "PD", None),
    "CC PID": ("cohen_coon", "PID", None),
    "TL PI": ("tyreus_luyben", "PI", None),
    "TL PID": ("tyreus_luyben", "PID", None),
    "IMC PI eps=1.7th": ("imc_pi", "PI", (0, 1.7)),
    "IMC impPI eps=1.7th": ("imc_improved_pi", "PI", (0, 1.7)),
    "IMC PID eps=.8th": ("imc_pid", "PID", (0, 0.8)),
    "lambda=tau PI": ("lambda_pi", "PI", (1, 0)),
    "lambda=3tau PI": ("lambda_pi", "PI", (3, 0)),
    "lambda=3th PI": ("lambda_pi", "PI", (0, 3)),
    "SIMC PI tc=th": ("simc", "PI", (0, 1)),
    "iSIMC PI tc=th": ("isimc", "PI", (0, 1)),
    "AMIGO PI": ("amigo", "PI", None),
    "AMIGO PID": ("amigo", "PID", None),
    "CHR sp 0% PI": ("chr_setpoint_0", "PI", None),
    "CHR sp 0% PID": ("chr_setpoint_0", "PID", None),
    "CHR sp 20% PI": ("chr_setpoint_20", "PI", None),
    "CHR sp 20% PID": ("chr_setpoint_20", "PID", None),
    "CHR load 0% PI": ("chr_load_0", "PI", None),
    "CHR load 0% PID": ("chr_load_0", "PID", None),
    "CHR load 20% PI": ("chr_load_20", "PI", None),
    "CHR load 20% PID": ("chr_load_20", "PID", None),
    "Shinskey PI": ("shinskey", "PI", None),
    "Lopez ITAE PI": ("lopez_itae", "PI", None),
    "Lopez ITAE PID": ("lopez_itae", "PID", None),
    "Rovira ITAE PI": ("rovira_itae", "PI", None),
    "Rovira ITAE PID": ("rovira_itae", "PID", None),
}
# First-order columns that the table has not, and the test that holds their numbers.
ELSEWHERE = {
    ("imc_pid_with_lag", "PID"): "test_published_settings",
    ("isimc", "PID"): "below, by margins",
    **{(f"chr_{aim}", "P"): "test_table_rules" for aim in (
        "setpoint_0", "setpoint_20", "load_0", "load_20",
    )},
    **{(f"{author}_{criterion}", structure): "test_minimum_error"
       for author, criterion in (("lopez", "ise"), ("lopez", "iae"), ("rovira", "iae"))
       for structure in ("PI", "PID")},
    **{(f"kappa_tau_{Ms}", structure): "test_table_rules"
       for Ms in (14, 20) for structure in ("PI", "PID")},
    **{(f"usort_{row}", "PI"): "test_table_rules"
       for row in ("load_20", "load_16", "setpoint_18", "setpoint_16")},
    ("usort_load_20", "PID"): "test_table_rules",
    ("amigo_frequency", "PI"): "test_table_rules",
    ("amigo_frequency", "PID"): "test_table_rules",
}  # fmt: skip


def _table() -> list[dict[str, str]]:
    with TABLE.open(encoding="utf-8") as lines:
        next(lines)  # the comment
        return [row for row in csv.DictReader(lines) if row["rule"] in COLUMNS]


ROWS = _table()
IDS = [f"{row['rule']}-{row['theta_over_tau']}" for row in ROWS]


def settings_of(row: dict[str, str]) -> PID:
    """Settings of the rule named in a row, at K = tau = 1."""
    rule, structure, speed = COLUMNS[row["rule"]]
    theta = float(row["theta_over_tau"])
    tau_c = speed[0] + speed[1] * theta if speed else None
    return RULES[rule].structures[structure](FOPDT(K=1.0, tau=1.0, theta=theta), tau_c)


@pytest.mark.parametrize("row", ROWS, ids=IDS)
def test_settings_are_those_of_the_table(row: dict[str, str]) -> None:
    pid = settings_of(row)
    assert pid.Kc == pytest.approx(float(row["KcK"]), abs=6e-6)
    assert pid.Ti == pytest.approx(float(row["Ti_over_tau"]), abs=6e-6)
    assert pid.Td == pytest.approx(float(row["Td_over_tau"]), abs=6e-6)
    assert pid.structure == COLUMNS[row["rule"]][1]


def test_every_published_rule_for_first_order_models_has_rows_in_the_table() -> None:
    in_table = {(rule, structure) for rule, structure, _ in COLUMNS.values()}
    covered = {
        (rule.name, structure)
        for rule in RULES.values()
        for structure, types in rule.takes.items()
        if "FOPDT" in types
    }
    assert set(ELSEWHERE) <= covered
    assert in_table == covered - set(ELSEWHERE)
    assert {row["rule"] for row in ROWS} == set(COLUMNS)


@pytest.fixture(scope="module")
def found() -> MarginBatch:
    plants = ProcessBatch(
        np.ones(len(ROWS)),
        np.ones(len(ROWS)),
        np.zeros(len(ROWS)),
        np.zeros(len(ROWS), int),
        np.array([float(row["theta_over_tau"]) for row in ROWS]),
    )
    pids = [settings_of(row) for row in ROWS]
    return batch_margins(
        plants,
        PIDBatch(
            np.array([p.Kc for p in pids]),
            np.array([p.Ti for p in pids]),
            np.array([p.Td for p in pids]),
        ),
    )


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("gain", "GM"),
        ("phase", "PM_deg"),
        ("delay", "delay_margin_over_tau"),
        ("Ms", "Ms_N10"),
        ("Mt", "Mt"),
    ],
)
def test_margins_of_the_settings_are_those_of_the_table(
    found: MarginBatch, name: str, column: str
) -> None:
    printed = np.array([float(row[column]) for row in ROWS])
    here = getattr(found, name)
    finite = np.isfinite(printed)
    np.testing.assert_array_equal(np.isfinite(here), finite)
    np.testing.assert_allclose(here[finite], printed[finite], rtol=0, atol=6e-5)
    assert np.all(found.stable)


def with_filter(pid: PID, N: float) -> PID:
    """The same settings with another derivative filter."""
    return replace(pid, N=N)


def test_simc_on_a_first_order_process() -> None:
    found = margins(FOPDT(K=1, tau=5, theta=1), simc_pi(FOPDT(K=1, tau=5, theta=1)))
    assert found.gain == pytest.approx(3.142, abs=5e-4)
    assert found.phase == pytest.approx(61.35, abs=5e-3)
    assert found.Ms == pytest.approx(1.590, abs=5e-4)
    assert found.Mt == pytest.approx(1.000, abs=5e-4)
    assert found.delay == pytest.approx(2.142, abs=5e-4)


def test_simc_on_an_integrator() -> None:
    found = margins(IPDT(K=1, theta=1), simc_pi(IPDT(K=1, theta=1)))
    assert found.gain == pytest.approx(2.963, abs=5e-4)
    assert found.phase == pytest.approx(46.86, abs=5e-3)
    assert found.Ms == pytest.approx(1.704, abs=5e-4)
    assert found.Mt == pytest.approx(1.299, abs=5e-4)
    assert found.delay == pytest.approx(1.590, abs=5e-4)


@pytest.mark.parametrize(
    ("alpha", "gain", "Ms"), [(0.0, 2.761, 1.959), (0.01, 2.536, 2.115), (0.1, 1.573, 5.32)]
)
def test_simc_on_two_integrators_depends_on_the_filter_that_runs(
    alpha: float, gain: float, Ms: float
) -> None:
    plant = DoubleIntegrator(K=1, theta=1)
    found = margins(plant, simc_double_integrating_pid(plant, alpha=alpha))
    assert found.gain == pytest.approx(gain, abs=5e-4)
    assert found.Ms == pytest.approx(Ms, abs=5e-3 if alpha == 0.1 else 5e-4)
    if alpha == 0:
        assert found.phase == pytest.approx(33.11, abs=5e-3)
        assert found.Mt == pytest.approx(1.832, abs=5e-4)


@pytest.mark.parametrize(
    ("tau1", "tau2", "Ms", "gain", "phase"),
    [
        pytest.param(1.0, 1.0, 1.599, 3.111, 61.07, id="E9"),
        pytest.param(20.0, 2.0, 1.671, 2.974, 51.93, id="E10"),
    ],
)
def test_simc_on_two_lags_as_in_its_examples(
    tau1: float, tau2: float, Ms: float, gain: float, phase: float
) -> None:
    """The examples run the series form with a filter of .01 Td'."""
    plant = SOPDT(K=1, tau1=tau1, tau2=tau2, theta=1)
    found = margins(plant, simc_second_order_pid(plant, alpha=0.01))
    assert found.Ms == pytest.approx(Ms, abs=5e-4)
    assert found.gain == pytest.approx(gain, abs=5e-4)
    assert found.phase == pytest.approx(phase, abs=5e-3)


def test_the_default_filter_of_simc_is_within_practice() -> None:
    """Series 0.05 Td' is an ISA N of 9 to 19, whatever the lags."""
    for ratio in (0.01, 0.3, 1.0):
        plant = SOPDT(K=1, tau1=1.0, tau2=ratio, theta=0.3)
        pid = simc_second_order_pid(plant)
        assert 9 <= pid.N <= 19
        assert SeriesPID.from_isa(pid).alpha == pytest.approx(0.05)


def test_reading_simc_series_settings_as_isa_is_another_controller() -> None:
    plant = SOPDT(K=1, tau1=1, tau2=1, theta=1)
    right = simc_second_order_pid(plant, alpha=0.01)
    wrong = PID(Kc=0.5, Ti=1, Td=1, N=100)
    assert margins(plant, right).Ms == pytest.approx(1.599, abs=5e-4)
    assert abs(margins(plant, wrong).Ms - 1.599) > 0.05


@pytest.mark.parametrize(("factor", "Ms"), [(1.0, 1.433), (0.5, 1.659)])
def test_improved_simc_pid(factor: float, Ms: float) -> None:
    """The values are quoted without tau or filter; within .001 they do not depend on them."""
    plant = FOPDT(K=1, tau=2, theta=1)
    found = margins(plant, isimc_pid(plant, factor, alpha=0.0))
    assert found.Ms == pytest.approx(Ms, abs=1.5e-3)


def test_improved_simc_pi_at_equal_lag_and_dead_time() -> None:
    plant = FOPDT(K=1, tau=1, theta=1)
    assert margins(plant, isimc_pi(plant)).Ms == pytest.approx(1.683, abs=5e-4)


def test_tyreus_luyben_on_an_integrator() -> None:
    plant = IPDT(K=1, theta=1)
    found = margins(plant, tyreus_luyben_pi(ultimate_point(plant)))
    assert 20 * math.log10(found.Mt) == pytest.approx(2.06, abs=5e-3)
    assert found.gain == pytest.approx(3.04, abs=5e-3)
    assert found.Ms == pytest.approx(1.67, abs=5e-3)


def test_amigo_on_an_integrator() -> None:
    plant = IPDT(K=1, theta=1)
    assert margins(plant, amigo_pi(plant)).Ms == pytest.approx(1.410, abs=5e-4)
    pid = amigo_pid(plant)
    assert margins(plant, with_filter(pid, math.inf)).Ms == pytest.approx(1.407, abs=5e-4)
    assert margins(plant, pid).Ms == pytest.approx(1.446, abs=5e-4)


@pytest.mark.parametrize("ratio", [0.1, 0.25, 0.5, 1.0, 2.0])
def test_amigo_keeps_its_ms_on_first_order_processes(ratio: float) -> None:
    plant = FOPDT(K=1, tau=1, theta=ratio)
    assert 1.205 < margins(plant, amigo_pi(plant)).Ms < 1.495
    pid = amigo_pid(plant)
    assert 1.3865 < margins(plant, with_filter(pid, math.inf)).Ms < 1.4665
    assert 1.405 < margins(plant, pid).Ms < 1.455


def test_the_heater_under_both_imc_controllers() -> None:
    """Anchor: the lagged settings on the heater, and what leaving the lag out does to them."""
    heater = FOPDT(K=2, tau=120, theta=30)
    found = margins(heater, PID(Kc=0.45, Ti=135, Td=13.3))
    assert found.gain == pytest.approx(7.28357, abs=5e-6)
    assert found.Ms == pytest.approx(1.16282, abs=5e-6)
