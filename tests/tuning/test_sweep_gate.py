"""The ±50 % gate against a table computed elsewhere, row by row.

Second route: `tests/reference/sweep50_gate.csv` was computed by other code with the two ends of
each parameter alone. The product sweeps eleven factors, so it could only be stricter; on these
rows no interior factor is worse than both ends, and every verdict is the same.
"""

import csv
import re
from functools import cache
from pathlib import Path

import pytest

from loop.controller import PID
from loop.process import FOPDT
from tuning.catalogue import RULES
from tuning.profiles import PROFILES
from tuning.sweep import FACTORS
from tuning.verification import Verification, verify_many

TABLE = Path(__file__).parents[1] / "reference" / "sweep50_gate.csv"

# Name in the table -> rule, structure and tau_c: a function of theta at tau = 1, or the default.
COLUMNS = {
    "ZN-RC PI": ("ziegler_nichols_reaction_curve", "PI", None),
    "ZN-RC PID": ("ziegler_nichols_reaction_curve", "PID", None),
    "ZN-ult PI": ("ziegler_nichols_ultimate", "PI", None),
    "ZN-ult PID": ("ziegler_nichols_ultimate", "PID", None),
    "CC PI": ("cohen_coon", "PI", None),
    "CC PID": ("cohen_coon", "PID", None),
    "TL PI": ("tyreus_luyben", "PI", None),
    "TL PID": ("tyreus_luyben", "PID", None),
    "IMC PI eps=1.7th": ("imc_pi", "PI", lambda theta: 1.7 * theta),
    "IMC impPI 1.7th": ("imc_improved_pi", "PI", lambda theta: 1.7 * theta),
    "IMC PID eps=.8th": ("imc_pid", "PID", lambda theta: 0.8 * theta),
    "lambda=tau PI": ("lambda_pi", "PI", lambda theta: 1.0),  # noqa: ARG005
    "lambda=max(tau,3th) PI": ("lambda_pi", "PI", None),
    "SIMC tc=th": ("simc", "PI", None),
    "SIMC tc=1.5th": ("simc", "PI", lambda theta: 1.5 * theta),
    "SIMC tc=2th": ("simc", "PI", lambda theta: 2.0 * theta),
    "SIMC tc=3th": ("simc", "PI", lambda theta: 3.0 * theta),
    "iSIMC PI tc=th": ("isimc", "PI", None),
    "AMIGO PI": ("amigo", "PI", None),
    "AMIGO PID": ("amigo", "PID", None),
}
RATIOS = ("0.1", "0.25", "0.5", "1.0", "2.0")


def _table() -> dict[tuple[str, str], dict[str, str]]:
    with TABLE.open(encoding="utf-8") as lines:
        next(lines)  # the comment
        return {(row["rule"], row["theta_over_tau"]): row for row in csv.DictReader(lines)}


ROWS = _table()


def _settings(column: str, theta: float) -> PID:
    rule, structure, speed = COLUMNS[column]
    tau_c = speed(theta) if speed else None
    return RULES[rule].structures[structure](FOPDT(K=1.0, tau=1.0, theta=theta), tau_c)


@cache
def _verified(ratio: str) -> dict[str, Verification]:
    theta = float(ratio)
    found = verify_many(
        FOPDT(K=1.0, tau=1.0, theta=theta),
        [_settings(column, theta) for column in COLUMNS],
        PROFILES["general"],
    )
    return dict(zip(COLUMNS, found, strict=True))


def _flag(row: dict[str, str], name: str) -> bool:
    return {"True": True, "False": False}[row[name]]


def test_the_table_has_every_column_at_every_ratio() -> None:
    assert set(ROWS) == {(column, ratio) for column in COLUMNS for ratio in RATIOS}


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("column", COLUMNS)
def test_verdicts_and_margins_are_those_of_the_table(column: str, ratio: str) -> None:
    row, found = ROWS[column, ratio], _verified(ratio)[column]

    assert found.nominal_passes == _flag(row, "nominal_pass")
    assert found.one_at_a_time_passes == _flag(row, "one_at_a_time_pass")
    assert found.passes == (_flag(row, "nominal_pass") and _flag(row, "one_at_a_time_pass"))
    assert found.corners_pass == _flag(row, "corners_pass")
    assert bool(found.sweep.stable.all()) == _flag(row, "one_at_a_time_stable")
    assert bool(found.corners.stable.all()) == _flag(row, "corners_stable")

    assert found.nominal.gain == pytest.approx(float(row["GM_nom"]), abs=6e-4)
    assert found.nominal.phase == pytest.approx(float(row["PM_nom"]), abs=0.06)
    assert found.nominal.Ms == pytest.approx(float(row["Ms_nom"]), abs=6e-4)


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("column", COLUMNS)
def test_the_worst_case_is_the_one_of_the_table(column: str, ratio: str) -> None:
    """The table writes K1.5tau1th1 for K x 1.5; other places may tie with it."""
    row, found = ROWS[column, ratio], _verified(ratio)[column]
    worst = found.worst["Ms"]
    assert worst.value == pytest.approx(float(row["Ms_worst_single"]), rel=1e-5, abs=6e-4)

    place = re.fullmatch(r"K([\d.]+)tau([\d.]+)th([\d.]+)", row["worst_single"])
    assert place is not None
    factors = [float(x) for x in place.groups()]
    moved = next(i for i, factor in enumerate(factors) if factor != 1)
    step = FACTORS.index(factors[moved])
    assert found.parameters == ("K", "tau", "theta")
    assert found.sweep.Ms[moved, step] == pytest.approx(worst.value, abs=6e-4)

    assert found.worst_corner["Ms"].value == pytest.approx(
        float(row["Ms_worst_corner"]), rel=1e-4, abs=6e-4
    )
    if found.sweep.stable.all():
        assert found.worst["gain"].value == pytest.approx(float(row["GM_worst_single"]), abs=6e-4)
        assert found.worst["phase"].value == pytest.approx(float(row["PM_worst_single"]), abs=0.06)
    else:
        assert found.gravest is not None
        assert found.gravest.target == "stable"


@pytest.mark.parametrize("ratio", [0.02, 0.05, 0.1, 0.5, 1.0, 2.0])
def test_these_pass_the_general_profile_over_the_usual_range(ratio: float) -> None:
    """AMIGO PI, SIMC at tau_c of 2 theta and more, lambda at its default."""
    process = FOPDT(K=1.0, tau=1.0, theta=ratio)
    settings = [
        RULES["amigo"].structures["PI"](process),
        RULES["simc"].structures["PI"](process, 2 * ratio),
        RULES["simc"].structures["PI"](process, 4 * ratio),
        RULES["lambda_pi"].structures["PI"](process),
    ]
    assert all(found.passes for found in verify_many(process, settings, PROFILES["general"]))


@pytest.mark.parametrize("ratio", [0.1, 0.5, 1.0, 2.0])
def test_these_fail_the_general_profile_over_the_usual_range(ratio: float) -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=ratio)
    failing = [
        ("cohen_coon", "PI"),
        ("cohen_coon", "PID"),
        ("ziegler_nichols_ultimate", "PI"),
        ("ziegler_nichols_ultimate", "PID"),
        ("ziegler_nichols_reaction_curve", "PID"),
        ("tyreus_luyben", "PID"),
        ("imc_pid", "PID"),
        ("amigo", "PID"),
        ("simc", "PI"),
    ]
    settings = [RULES[rule].structures[structure](process) for rule, structure in failing]
    found = verify_many(process, settings, PROFILES["general"])
    assert not any(v.passes for v in found)
    simc = found[-1].worst["Ms"].value
    assert 2.125 < simc < 2.915  # printed 2.13 to 2.90


def test_below_a_hundredth_amigo_pi_fails_too() -> None:
    process = FOPDT(K=1.0, tau=1.0, theta=0.002)
    pid = RULES["amigo"].structures["PI"](process)
    assert not verify_many(process, [pid], PROFILES["general"])[0].passes
