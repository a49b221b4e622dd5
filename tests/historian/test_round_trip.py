"""Whatever shape a table is written in, the same samples come back, exactly."""

import gzip
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from historian.csv_file import read_export
from historian.export import Export
from historian.options import Layout, ReadOptions

START = datetime.fromisoformat("2024-02-20T06:00:00")  # local time, as plants write it
TIME_FORMATS = {
    "%Y-%m-%d %H:%M:%S": "Y/M/D",
    "%Y-%m-%dT%H:%M:%S": "Y/M/D",
    "%Y/%m/%d %H:%M:%S": "Y/M/D",
    "%Y%m%d%H%M%S": "Y/M/D",
    "%d-%b-%y %H:%M:%S": "D-MMM-Y",
    "%d-%b-%Y %H:%M:%S": "D-MMM-Y",
    "%d.%m.%Y %H:%M:%S": "D/M/Y",
    "%d/%m/%Y %H:%M:%S": "D/M/Y",
    "%m/%d/%Y %I:%M:%S %p": "M/D/Y",
    "%m/%d/%y %H:%M:%S": "M/D/Y",
}
TAGS = ("FIC101.PV", "FIC101.SP", "FIC101.OP")
GAP_WORDS = ("", "Bad", "No Data", "#N/A", "NaN", "[-11059] No Good Data For Calculation")


@dataclass(frozen=True)
class Written:
    """How a table is written."""

    layout: Layout
    delimiter: str
    decimal: str
    time_format: str
    line_end: str
    encoding: str
    order: str
    packed: bool
    final_line_end: bool


numbers = st.one_of(
    st.integers(-(10**6), 10**6).map(float),
    st.floats(-1e6, 1e6, allow_nan=False).map(lambda value: round(value, 4)),
    st.floats(-1e30, 1e30, allow_nan=False),
).filter(lambda value: value == 0 or abs(value) > 1e-37)
cells = st.one_of(numbers, numbers, numbers, st.sampled_from(GAP_WORDS))
shapes = st.builds(
    Written,
    layout=st.sampled_from(list(Layout)),
    delimiter=st.sampled_from([",", ";", "\t", "|"]),
    decimal=st.sampled_from([".", ","]),
    time_format=st.sampled_from(list(TIME_FORMATS)),
    line_end=st.sampled_from(["\n", "\r\n", "\r"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    order=st.sampled_from(["oldest first", "newest first"]),
    packed=st.booleans(),
    final_line_end=st.booleans(),
).filter(lambda shape: shape.delimiter != shape.decimal)


def text_of(cell: float | str, shape: Written) -> str:
    if isinstance(cell, str):
        return cell
    return repr(cell).replace(".", shape.decimal)


def lines_of(shape: Written, stamps: list[str], columns: list[list[float | str]]) -> list[str]:
    rows = list(zip(stamps, *columns, strict=True))
    if shape.order == "newest first":
        rows.reverse()
    cell_rows: list[list[str]] = []
    if shape.layout is Layout.WIDE:
        cell_rows.append(["Time", *TAGS])
        cell_rows += [[row[0], *(text_of(cell, shape) for cell in row[1:])] for row in rows]
    elif shape.layout is Layout.PAIRS:
        cell_rows.append([cell for tag in TAGS for cell in ("Time", tag)])
        cell_rows += [
            [text for cell in row[1:] for text in (row[0], text_of(cell, shape))] for row in rows
        ]
    else:
        cell_rows.append(["Tag", "Time", "Value"])
        cell_rows += [
            [tag, row[0], text_of(cell, shape)]
            for row in rows
            for tag, cell in zip(TAGS, row[1:], strict=True)
        ]
    return [shape.delimiter.join(row) for row in cell_rows]


def written(folder: str, shape: Written, lines: list[str]) -> Path:
    text = shape.line_end.join(lines) + (shape.line_end if shape.final_line_end else "")
    data = text.encode(shape.encoding)
    path = Path(folder) / "export.csv"
    path.write_bytes(gzip.compress(data) if shape.packed else data)
    return path


def expected(column: list[float | str]) -> list[float]:
    return [float("nan") if isinstance(cell, str) else cell for cell in column]


@settings(max_examples=150, deadline=None)
@given(
    shape=shapes,
    columns=st.integers(3, 30).flatmap(
        lambda n: st.lists(st.lists(cells, min_size=n, max_size=n), min_size=3, max_size=3)
    ),
    step=st.integers(1, 7200),
)
def test_every_shape_reads_back_exactly(
    shape: Written, columns: list[list[float | str]], step: int
) -> None:
    columns = [[1.5, *column] for column in columns]  # one plain decimal settles the mark
    moments = [START + timedelta(seconds=step * k) for k in range(len(columns[0]))]
    stamps = [moment.strftime(shape.time_format) for moment in moments]
    with TemporaryDirectory() as folder:
        path = written(folder, shape, lines_of(shape, stamps, columns))
        options = ReadOptions(decimal=shape.decimal, layout=shape.layout)
        export = read_export(path, options=options)
    assert export.decisions.time_format == TIME_FORMATS[shape.time_format]
    assert export.decisions.delimiter == shape.delimiter
    assert_same(export, moments, columns)
    assert export.accounting.rows_rejected == 0
    assert export.accounting.rejected_cells == 0


def assert_same(export: Export, moments: list[datetime], columns: list[list[float | str]]) -> None:
    for tag, column in zip(TAGS, columns, strict=True):
        signal = export.signals[tag]
        assert signal.time.astype("datetime64[s]").tolist() == moments
        assert np.array_equal(signal.value, expected(column), equal_nan=True)
    record = export.record("FIC101")
    assert np.array_equal(record.pv, expected(columns[0]), equal_nan=True)
    assert np.array_equal(record.op, expected(columns[2]), equal_nan=True)


@settings(max_examples=60, deadline=None)
@given(
    values=st.lists(numbers, min_size=2, max_size=40),
    spacings=st.lists(st.floats(1e-3, 1e4), min_size=39, max_size=39),
    decimal=st.sampled_from([".", ","]),
)
def test_elapsed_seconds_read_back_exactly(
    values: list[float], spacings: list[float], decimal: str
) -> None:
    t = np.cumsum([0.0, *spacings[: len(values) - 1]])
    lines = ["t_s;pv;op", *(f"{a!r};{b!r};1.5" for a, b in zip(t.tolist(), values, strict=True))]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "step.csv"
        path.write_text("\n".join(lines).replace(".", decimal) + "\n")
        record = read_export(path, options=ReadOptions(decimal=decimal)).record()
    assert np.array_equal(record.t, t)
    assert record.pv.tolist() == values
