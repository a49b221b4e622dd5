"""Reading a file in parts gives what reading it as a whole gives."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from historian.accounting import Accounting
from historian.csv_file import read_export
from historian.errors import ExportRefused
from historian.export import Export
from historian.export_parts import RunningAccount, read_in_parts
from historian.options import ReadOptions

NOTE = "x" * 400
BLOCK = 4 * 1024 * 1024  # the reader takes no less at a time


@pytest.fixture
def write(tmp_path: Path) -> Callable[[list[str]], Path]:
    def write(lines: list[str]) -> Path:
        path = tmp_path / "export.csv"
        path.write_text("time,F.PV,F.OP,F.MODE,note\n" + "\n".join(lines) + "\n")
        return path

    return write


def lines(seconds: list[int], *, odd: int | None = None) -> list[str]:
    """Write rows with a long note, so that few of them fill a block."""
    stamps = np.datetime_as_string(np.datetime64("2026-01-01", "s") + np.array(seconds), unit="s")
    rows = [f"{stamp}Z,{n}.0,{n % 7}.5,AUTO,{NOTE}" for n, stamp in enumerate(stamps.tolist())]
    if odd is not None:
        rows[odd] = rows[odd].replace("AUTO", "HUMAN")
        rows[odd + 1] = rows[odd + 1].replace(f"{odd + 1}.0", "Bad.0", 1)
        rows[odd + 2] = "no time," + rows[odd + 2].partition(",")[2]
    return rows


def in_parts(path: Path, **options: str) -> tuple[list[Export], RunningAccount]:
    account, parts = RunningAccount(), []
    for part in read_in_parts(path, options=ReadOptions(**options), part_bytes=BLOCK):
        loop = next(iter(part.loops.values()))
        account.add(loop.accounting, loop.time)
        parts.append(part)
    return parts, account


N = 26_000
GAP = [*range(12_000), *range(18_000, 112_000)]


@pytest.mark.parametrize(
    ("seconds", "odd"),
    [
        (list(range(N)), 15_000),
        (list(range(N))[::-1], None),
        (GAP, 5),
        (list(range(13_000)) * 2, None),
    ],
    ids=["in order", "newest first", "with a gap", "all twice"],
)
def test_the_parts_are_the_whole(
    write: Callable[[list[str]], Path], seconds: list[int], odd: int | None
) -> None:
    path = write(lines(seconds, odd=odd))
    whole = read_export(path)
    parts, account = in_parts(path)

    assert len(parts) > 1
    together, there = account.total(), whole.loops["F"].accounting
    for part in parts:
        loop = part.loops["F"]
        rows = np.searchsorted(whole.loops["F"].time, loop.time)
        np.testing.assert_array_equal(whole.loops["F"].time[rows], loop.time)
    if len({*seconds}) == len(seconds):
        order = np.argsort(np.concatenate([part.loops["F"].time for part in parts]))
        for name in ("time", "pv", "op", "mode"):
            joined = np.concatenate([getattr(part.loops["F"], name) for part in parts])[order]
            np.testing.assert_array_equal(joined, getattr(whole.loops["F"], name))
        assert together == there
        assert parts[-1].decisions == whole.decisions
    else:  # what repeats over the border of two parts is for the sample store to join
        assert together.rows_kept + together.duplicates == there.rows_kept + there.duplicates
        assert together.disordered


def test_a_gap_at_the_border_of_two_parts_is_counted(write: Callable[[list[str]], Path]) -> None:
    parts, _ = in_parts(write(lines(list(range(N)))))
    first = len(parts[0].loops["F"].time)
    path = write(lines([*range(first), *range(first + 500, N)]))
    _, account = in_parts(path)
    whole = read_export(path).loops["F"].accounting
    assert (account.total().gaps, account.total().longest_gap) == (whole.gaps, whole.longest_gap)
    assert whole.gaps == 1


def test_elapsed_time_is_read_in_parts_too(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text("t [s],PV,OP,note\n" + "".join(f"{n},{n}.0,1,{NOTE}\n" for n in range(N)))
    parts, account = in_parts(path)
    assert len(parts) > 1
    assert account.total() == next(iter(read_export(path).loops.values())).accounting


@pytest.mark.parametrize("step", [2, 30, 60], ids=["12 hours", "8 days", "16 days"])
def test_local_time_is_never_cut_where_the_clock_is_set_back(
    write: Callable[[list[str]], Path], step: int
) -> None:
    middle = np.datetime64("2026-10-25T01:00", "s")  # when it is set back, in UTC
    stamps = middle + (step * np.arange(N) - step * N // 2).astype("m8[s]")
    berlin = np.where(stamps < middle, 7200, 3600).astype("m8[s]")
    local = np.datetime_as_string(stamps + berlin, unit="s").tolist()
    path = write([f"{stamp},{n}.0,{n % 7}.5,AUTO,{NOTE}" for n, stamp in enumerate(local)])
    parts, account = in_parts(path, time_zone="Europe/Berlin")
    assert len(parts) == (1 if step == 2 else 2)
    times = np.concatenate([part.loops["F"].time for part in parts])
    np.testing.assert_array_equal(times, stamps)
    whole = read_export(path, options=ReadOptions(time_zone="Europe/Berlin"))
    assert account.total() == whole.loops["F"].accounting


def test_other_layouts_and_unknown_zones_are_read_as_one_part(
    write: Callable[[list[str]], Path], tmp_path: Path
) -> None:
    local = [line.replace("Z,", ",") for line in lines(list(range(N)))]
    assert len(in_parts(write(local))[0]) == 1
    long = tmp_path / "long.csv"
    long.write_text(
        "tag,time,value\n"
        + "".join(
            f"F.{part},2026-01-01T00:00:0{n}Z,{n}\n" for n in range(9) for part in ("PV", "OP")
        )
    )
    parts, account = in_parts(long)
    assert len(parts) == 1
    assert account.total() == parts[0].loops["F"].accounting


def test_lines_before_the_first_sample_are_left_out(write: Callable[[list[str]], Path]) -> None:
    path = write(lines(list(range(20))))
    options = ReadOptions(header_line=1, first_line=9)
    (part,) = read_in_parts(path, options=options)
    assert len(part.loops["F"].time) == 13
    late = replace(options, first_line=2_000)
    with pytest.raises(ExportRefused):
        list(read_in_parts(path, options=late))


def test_a_stretch_without_any_row_is_passed_and_a_file_without_is_refused(
    write: Callable[[list[str]], Path],
) -> None:
    good = lines(list(range(4_000)))
    bad = [f"no time,1,1,AUTO,{NOTE}"] * 20_000
    path = write([*good, *bad, *lines(list(range(4_000, 4_060)))])
    parts, account = in_parts(path)
    assert sum(len(part.loops["F"].time) for part in parts) == 4_060
    assert account.total().rows_rejected == 20_000
    whole = read_export(path).loops["F"].accounting
    assert account.total() == whole


def test_a_single_row_without_a_line_end_is_read(write: Callable[[list[str]], Path]) -> None:
    path = write(lines([0]))
    path.write_bytes(path.read_bytes().rstrip())
    (part,) = read_in_parts(path, options=ReadOptions())
    assert part.loops["F"].pv.tolist() == [0.0]


def test_a_file_without_any_possible_time_is_refused(write: Callable[[list[str]], Path]) -> None:
    path = write([line.replace("2026-", "2526-") for line in lines(list(range(20)))])
    with pytest.raises(ExportRefused) as refusal:
        read_export(path)
    with pytest.raises(ExportRefused, match=re.escape(str(refusal.value))):
        list(read_in_parts(path, options=ReadOptions()))


def test_a_loop_without_samples_has_an_account_too() -> None:
    account = RunningAccount()
    account.add(Accounting(rows_read=3, rows_rejected=3), np.empty(0))
    assert account.total() == Accounting(rows_read=3, rows_rejected=3)
