"""Damaged and random files are read or refused, never a traceback; good lines are kept."""

import io
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from historian.csv_file import read_export
from historian.errors import ExportRefused
from historian.options import Layout, ReadOptions

EXPORTS = sorted(p for p in (Path(__file__).parent / "exports").glob("*.*") if p.suffix)
FIXTURES = [path.read_bytes() for path in EXPORTS]


def read_or_refuse(data: bytes, options: ReadOptions | None = None) -> None:
    """Read bytes as a file: only a refusal in words may stop it, and rows always add up."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "export.csv"
        path.write_bytes(data)
        try:
            export = read_export(path, options=options or ReadOptions())
        except ExportRefused:
            return
    account = export.accounting
    assert account.rows_read == account.rows_kept + account.rows_rejected + account.duplicates
    for signal in export.signals.values():
        assert signal.time.size == signal.value.size
        assert np.all(np.diff(signal.time.astype(np.float64)) >= 0)
        assert not np.any(np.isinf(signal.value))
    for loop in export.loops:
        try:
            assert len(export.record(loop)) > 0
        except ExportRefused:
            assert export.loops[loop].time.size == 0


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=400))
def test_random_bytes(data: bytes) -> None:
    read_or_refuse(data)


alphabet = st.sampled_from(list("0123456789.,;:-/ \t\n\r\"'eE+TZabc*#[]\0é"))


@settings(max_examples=250, deadline=None)
@given(st.text(alphabet, max_size=200), st.sampled_from([None, *Layout]))
def test_random_text_of_the_usual_characters(text: str, layout: Layout | None) -> None:
    read_or_refuse(text.encode(), ReadOptions(layout=layout))


@settings(max_examples=250, deadline=None)
@given(data=st.data(), fixture=st.sampled_from(FIXTURES))
def test_truncated_and_overwritten_exports(data: st.DataObject, fixture: bytes) -> None:
    damaged = bytearray(fixture[: data.draw(st.integers(0, len(fixture)), label="cut at")])
    for _ in range(data.draw(st.integers(0, 4), label="overwrites")):
        if damaged:
            place = data.draw(st.integers(0, len(damaged) - 1), label="place")
            damaged[place] = data.draw(st.sampled_from(b'\0\n\r",;.\xff9A-'), label="byte")
    read_or_refuse(bytes(damaged))


lines = st.lists(
    st.sampled_from(
        [
            "2024-02-01 10:00:{k:02d},{k},2,3",
            "2024-02-01 10:00:{k:02d},{k},2",
            "2024-02-01 10:00:{k:02d},{k},2,3,,",
            "2024-02-01 10:00:{k:02d},Bad,Kaputt,3",
            "2024-02-01 10:61:{k:02d},{k},2,3",
            ",,,",
            ",{k},2,3",
            "",
            "Time,X.PV,X.SP,X.OP",
            "* a remark",
            "[Section]",
            '2024-02-01 10:00:{k:02d},"{k}",2,3',
            '2024-02-01 10:00:{k:02d},"{k},2,3',
            "no Time,{k},2,3",
        ]
    ),
    max_size=29,
)


@settings(max_examples=150, deadline=None)
@given(lines)
def test_any_mixture_of_good_and_bad_lines(templates: list[str]) -> None:
    """Every good line is found, whatever stands around it; a slow second reading agrees."""
    good = "2024-02-01 10:00:{k:02d},{k},2,3"
    written = ["Time,X.PV,X.SP,X.OP", *(good.format(k=k) for k in range(30))]
    written += [template.format(k=k) for k, template in enumerate(templates, start=30)]
    expected = {float(k): float(k) for k in range(30)}
    rejected = []
    for number, line in enumerate(written[31:], start=32):
        k = float(number - 2)
        cells = [cell.strip('"') for cell in line.split(",")]
        if line.startswith("2024-02-01 10:00:") and line.count('"') % 2 == 0:
            if len(cells) == 3:
                rejected.append(number)
            else:
                expected[k] = float("nan") if cells[1] == "Bad" else k
        elif line.startswith(("2024-02-01 10", "no Time")) or (line[:1] == "," and cells[1]):
            rejected.append(number)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "export.csv"
        path.write_text("\n".join(written) + "\n")
        export = read_export(path)
    record = export.record()
    assert record.t.tolist() == sorted(expected)
    assert np.array_equal(record.pv, [expected[t] for t in sorted(expected)], equal_nan=True)
    whole_rows = [r.line for r in export.accounting.rejections if r.column == ""]
    assert whole_rows == rejected


def test_rejections_are_counted_beyond_those_listed(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    rows = "".join(f"{k},1,2\n" for k in range(90))
    path.write_text(
        "time,pv,op\n" + rows + "x,1,2\n" * 50 + "".join(f"{k},Kaputt,2\n" for k in range(90, 93))
    )
    account = read_export(path, options=ReadOptions(max_rejections=10)).accounting
    assert len(account.rejections) == 10
    assert account.rows_rejected == 50
    assert account.rejections[0].line == 92
    assert sum(account.reasons.values()) == 50 + 3


def test_an_encrypted_archive_is_refused_in_words(tmp_path: Path) -> None:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("a.csv", "time,pv,op\n0,1,2\n")
    packed = bytearray(data.getvalue())
    for header in (b"PK\x03\x04", b"PK\x01\x02"):
        place = packed.index(header)
        packed[place + (6 if header == b"PK\x03\x04" else 8)] |= 1
    path = tmp_path / "export.zip"
    path.write_bytes(packed)
    with pytest.raises(ExportRefused, match="without a password"):
        read_export(path)
