"""Real files from real plants and laboratories, where they are at hand."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from historian.csv_file import read_export
from historian.errors import ExportRefused
from historian.options import Columns, ReadOptions
from loop.record import Mode

DATA = Path(__file__).parents[2].parent / "shared" / "data"

pytestmark = pytest.mark.skipif(not DATA.exists(), reason="../shared/data is not at hand")


def files(pattern: str) -> list[Path]:
    return sorted(DATA.glob(pattern))


def test_refinery_episodes_give_the_rows_and_columns_of_the_file() -> None:
    paths = files("refinery_loops/stic_*.txt")
    assert len(paths) == 43
    for path in paths:
        export = read_export(path, options=ReadOptions(mode_codes={1: Mode.AUTO}))
        record = export.record()
        lines = path.read_text(encoding="utf-8").splitlines()
        assert export.accounting.rows_read == len(lines) - 5
        names = lines[2].split("\t")
        table = pd.read_csv(path, sep="\t", skiprows=5, names=names).drop_duplicates(
            names[0], keep="last"
        )
        for values, column in ((record.op, 1), (record.pv, 2), (record.sp, 3)):
            expected = table.iloc[:, column].to_numpy()
            assert values is not None
            assert np.array_equal(values, np.where(np.abs(expected) < 1e-37, 0, expected))
        assert record.mode is not None
        assert set(record.mode.tolist()) == {Mode.AUTO}
        assert record.tag in names[2]


def test_duplicate_stamps_of_a_refinery_episode_are_counted() -> None:
    (path,) = files("refinery_loops/*FIC10112_0630*")
    account = read_export(path).accounting
    assert (account.rows_read, account.rows_kept, account.duplicates) == (751, 726, 25)


def test_laboratory_steps_have_elapsed_seconds() -> None:
    paths = files("tclab_steps/*.csv")
    assert len(paths) == 17
    for path in paths:
        record = read_export(path, options=ReadOptions(columns=Columns(pv="T1", op="Q1"))).record()
        table = pd.read_csv(path)
        assert np.array_equal(record.t, table["t_s"])
        assert np.array_equal(record.pv, table["T1"])
        assert np.array_equal(record.op, table["Q1"])
        assert record.start is None


@pytest.mark.parametrize(
    ("name", "op", "pv", "header"),
    [
        ("arduino_1st_order_step.csv", 2, 3, None),
        ("arduino_apm_stats.csv", 2, 3, 0),
        ("arduino_energy_mimo.txt", 2, 4, 0),
        ("arduino_higher_mimo.csv", 2, 4, None),
        ("arduino_mimo_gekko.txt", 2, 4, 0),
        ("pds_TCLab_data.csv", 2, 3, 0),
    ],
)
def test_laboratory_runs_by_column_number(name: str, op: int, pv: int, header: int | None) -> None:
    path = DATA / "tclab_apm" / name
    record = read_export(path, options=ReadOptions(columns=Columns(pv=pv, op=op))).record()
    table = pd.read_csv(path, header=header)
    assert np.array_equal(record.t, table.iloc[:, 0])
    assert np.array_equal(record.pv, table.iloc[:, pv - 1])
    assert np.array_equal(record.op, table.iloc[:, op - 1])


def test_plant_week_newest_first_with_empty_cells() -> None:
    (path,) = files("historian_exports/FIC-211*.csv")
    options = ReadOptions(columns=Columns(pv="FT_211", op="FV_211"), time_zone="Asia/Shanghai")
    export = read_export(path, options=options)
    record = export.record()
    table = pd.read_csv(path, encoding="utf-8-sig").iloc[::-1]
    assert np.array_equal(record.pv, table["FT_211"], equal_nan=True)
    assert np.array_equal(record.op, table["FV_211"], equal_nan=True)
    assert str(record.start) == "2024-11-20 16:00:00+00:00"
    assert np.array_equal(record.t, 60.0 * np.arange(10_080))
    missing = int(table[["FT_211", "FV_211"]].isna().to_numpy().sum())
    assert sum(export.accounting.gap_words.values()) + export.accounting.empty_cells == missing


def test_every_file_at_hand_is_read_or_refused_in_words() -> None:
    for path in files("*/*.*"):
        try:
            assert read_export(path).accounting.rows_kept > 0
        except ExportRefused as refused:
            pytest.fail(f"{path.name}: {refused}")
