"""Step tests of a real heater: good repeats agree, the failed one is refused, no record crashes."""

import csv
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from identification.identify import Identification, identify
from identification.repeats import gain_over_level, pool
from identification.verdict import Verdict
from loop.process import FOPDT
from loop.record import Record

DATA = Path(__file__).parents[3] / "shared" / "data"
pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="../shared/data, the real step tests, is not beside this project"
)
STEPS = [
    *(("0", f"sp_ensH1_000_{to}_en1") for to in ("010", "020", "050", "060", "080", "100")),
    ("50", "sp_ensH1_050_000_en1"),
    ("100", "sp_ensH1_100_000_en1"),
]
MINUTE, SPACING = 240, 0.25


@cache
def readings(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, temperature and power without the two rows that hold a placeholder."""
    rows = np.loadtxt(DATA / "tclab_steps" / f"{name}.csv", delimiter=",", skiprows=1)[2:]
    return rows[:, 0], rows[:, 1], rows[:, 3]


def prepared(name: str, power_before: float, prefix: str) -> Record:
    """Put a minute of the first real reading at the power before in front of the recording."""
    t, pv, op = readings(name)
    minute = t[0] - SPACING * np.arange(MINUTE, 0, -1)
    rng = np.random.default_rng(len(name))
    before = {
        "normal noise": pv[0] + rng.normal(0, 0.4, MINUTE),
        "constant": np.full(MINUTE, pv[0]),
        "noise of the end": pv[0] + pv[-MINUTE:] - pv[-MINUTE:].mean(),
    }[prefix]
    return Record(
        t=np.concatenate((minute, t)),
        pv=np.concatenate((before, pv)),
        op=np.concatenate((np.full(MINUTE, power_before), op)),
    )


def assert_known_model(found: Identification) -> None:
    assert isinstance(found.process, FOPDT)
    gain = found.process.K
    assert gain == pytest.approx(1.00, rel=0.05)
    assert found.process.tau == pytest.approx(191, rel=0.05)
    assert found.process.theta == pytest.approx(21, abs=6)


@pytest.mark.parametrize("prefix", ["normal noise", "constant", "noise of the end"])
@pytest.mark.parametrize("repeat", ["01", "02", "03", "05"])
def test_good_repeats_give_the_known_model(repeat: str, prefix: str) -> None:
    found = identify(prepared(f"sp_ens_IdentificacaoH1_0to50_{repeat}", 0, prefix))
    assert_known_model(found)


@pytest.mark.parametrize("repeat", ["01", "02", "03", "05"])
def test_the_stated_power_before_serves_as_well_as_a_minute_of_it(repeat: str) -> None:
    t, pv, op = readings(f"sp_ens_IdentificacaoH1_0to50_{repeat}")
    found = identify(Record(t=t, pv=pv, op=op, op_before=0.0))
    assert_known_model(found)


@pytest.mark.parametrize("prefix", ["normal noise", "constant", "noise of the end"])
def test_the_failed_repeat_is_refused_because_nothing_follows(prefix: str) -> None:
    found = identify(prepared("sp_ens_IdentificacaoH1_0to50_04", 0, prefix))
    assert found.verdict is Verdict.REFUSED
    assert "PV hardly follows the move of +50" in found.reasons[0]


def test_without_the_power_before_there_is_no_move() -> None:
    t, pv, op = readings("sp_ens_IdentificacaoH1_0to50_01")
    found = identify(Record(t=t, pv=pv, op=op))
    assert found.verdict is Verdict.REFUSED
    assert "--op-before" in found.reasons[0]


@pytest.mark.parametrize(("power", "name"), STEPS)
def test_other_steps_give_models_like_them(power: str, name: str) -> None:
    found = identify(prepared(name, float(power), "normal noise"))
    assert isinstance(found.process, FOPDT)
    assert 0.88 < found.process.K < 1.03
    assert 150 < found.process.tau < 205
    assert 5 < found.process.theta < 28


def test_the_gain_falls_with_the_power() -> None:
    gains = []
    for to in ("050", "100"):
        t, pv, op = readings(f"sp_ensH1_000_{to}_en1")
        found = identify(Record(t=t, pv=pv, op=op, op_before=0.0))
        assert isinstance(found.process, FOPDT)
        gains.append(found.process.K)
    assert gains == pytest.approx([1.006, 0.907], abs=0.02)


def repeats() -> list[Identification]:
    names = (f"sp_ens_IdentificacaoH1_0to50_{repeat}" for repeat in ("01", "02", "03", "04", "05"))
    return [identify(prepared(name, 0, "normal noise")) for name in names]


def test_the_repeats_pool_to_the_known_model_and_the_failed_one_is_thrown_out() -> None:
    found = pool(repeats())
    assert found.used == (0, 1, 2, 4)
    assert [test.index for test in found.left_out] == [3]
    assert "PV hardly follows" in found.left_out[0].reason
    gain = found.process.K
    assert gain == pytest.approx(1.00, abs=0.02)
    assert found.process.tau == pytest.approx(191, abs=3)
    assert found.process.theta == pytest.approx(21, abs=2)


def test_the_intervals_of_a_small_step_contain_the_pooled_model() -> None:
    pooled = pool(repeats()).process
    small = identify(prepared("sp_ensH1_000_010_en1", 0, "normal noise"))
    assert small.intervals is not None
    truth = np.array([pooled.K, pooled.tau, pooled.theta])
    assert np.all(small.intervals[:, 0] < truth)
    assert np.all(truth < small.intervals[:, 1])


def test_the_gain_that_falls_with_the_power_is_reported_as_no_linear_process() -> None:
    names = (f"sp_ensH1_000_{to}_en1" for to in ("050", "060", "070", "080", "090", "100"))
    found = gain_over_level([identify(prepared(name, 0, "normal noise")) for name in names])
    assert found.certain
    assert found.low == pytest.approx(1.00, abs=0.03)
    assert found.high == pytest.approx(0.91, abs=0.02)
    assert "the process is not linear" in found.sentence


def columns(path: Path) -> np.ndarray:
    rows = []
    with path.open(encoding="utf-8-sig") as lines:
        for fields in csv.reader(lines):
            try:
                rows.append([float(field) for field in fields])
            except ValueError:
                continue
    return np.array([row for row in rows if len(row) == len(rows[0])])


@pytest.mark.parametrize("path", sorted((DATA / "tclab_apm").glob("*")), ids=lambda p: p.name)
def test_runs_of_the_other_laboratory_get_a_verdict_with_reasons(path: Path) -> None:
    data = columns(path)
    heaters = (data.shape[1] - 1) // 2
    for heater in range(min(heaters, 2)):
        found = identify(
            Record(t=data[:, 0], op=data[:, 1 + heater], pv=data[:, 1 + min(heaters, 2) + heater])
        )
        assert found.reasons
        assert found.fitted is not None
        if found.verdict is not Verdict.REFUSED:
            assert isinstance(found.fitted, FOPDT)
            assert 0 < found.fitted.K < 1
            assert 60 < found.fitted.tau < 300


def test_a_week_of_routine_operation_is_no_step_test() -> None:
    path = next((DATA / "historian_exports").glob("FIC-211*"))
    with path.open(encoding="utf-8-sig") as lines:
        rows = list(csv.DictReader(lines))
    rows.reverse()

    def signal(name: str) -> list[float]:
        return [float(row[name]) if row[name] not in ("", "NULL") else float("nan") for row in rows]

    found = identify(
        Record(t=60.0 * np.arange(len(rows)), pv=signal("FT_211"), op=signal("FV_211"))
    )
    assert found.verdict is Verdict.REFUSED
    assert found.reasons
