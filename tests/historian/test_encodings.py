"""Bytes to lines: encodings stated and found, line ends, blocks larger and smaller than a line."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from historian import encoding as encodings
from historian.csv_file import decide, read_export
from historian.encoding import decide_encoding, keeps_ascii
from historian.errors import ExportRefused
from historian.options import ReadOptions

ROWS = [f"{k},{k / 8},{50 - k / 4}" for k in range(300)]
TABLE = "\n".join(["time,Größe.PV,Größe.OP", *ROWS, ""])


@pytest.mark.parametrize(
    ("name", "stated", "mark"),
    [
        ("utf-8", None, b""),
        ("utf-8", "utf-8", b"\xef\xbb\xbf"),
        ("utf-16-le", None, b"\xff\xfe"),
        ("utf-16-be", None, b"\xfe\xff"),
        ("utf-16-be", "utf-16", b"\xfe\xff"),
        ("utf-16-le", "utf-16-le", b""),
        ("utf-16-be", None, b""),
        ("utf-32-le", None, b"\xff\xfe\x00\x00"),
        ("latin-1", None, b""),
        ("cp1252", "cp1252", b""),
        ("cp437", "cp437", b""),
        ("cp500", "cp500", b""),
    ],
)
def test_every_encoding_gives_the_same_samples(
    tmp_path: Path, name: str, stated: str | None, mark: bytes
) -> None:
    path = tmp_path / "export.csv"
    path.write_bytes(mark + TABLE.encode(name))
    record = read_export(path, options=ReadOptions(encoding=stated)).record()
    assert record.tag == "Größe"
    assert record.pv.tolist() == [k / 8 for k in range(300)]


@pytest.mark.parametrize("stated", ["no-such-code", "rot13", "hex", "idna"])
def test_encodings_that_cannot_be_are_refused(tmp_path: Path, stated: str) -> None:
    path = tmp_path / "export.csv"
    path.write_bytes(TABLE.encode() * 10)
    with pytest.raises(ExportRefused, match="encoding"):
        read_export(path, options=ReadOptions(encoding=stated))


def test_a_tag_in_another_encoding_than_the_start_of_the_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    rows = "".join(f"X.PV,{k},1\n" for k in range(40_000)).encode()
    path.write_bytes(b"Tag,time,Value\n" + rows + "Größe.PV,0,2\n".encode("latin-1"))
    export = read_export(path)
    assert export.decisions.encoding == "utf-8"
    assert list(export.signals) == ["X.PV", "Größe.PV"]


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("block", [40, 64, 1000])
def test_blocks_end_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line_end: str, block: int
) -> None:
    monkeypatch.setattr(encodings, "BLOCK_BYTES", block)
    monkeypatch.setattr("historian.planning.HEAD_BYTES", 400)
    path = tmp_path / "export.csv"
    lines = ["time,pv,op", *ROWS[:150], "x,1,2", "", "150,Kaputt,3", *ROWS[151:], ""]
    path.write_bytes(line_end.join(lines).encode())
    seen: list[int] = []
    export = read_export(path, progress=seen.append)
    record = export.record()
    assert record.t.tolist() == list(range(300))
    assert np.flatnonzero(np.isnan(record.pv)).tolist() == [150]
    assert [(r.line, r.text) for r in export.accounting.rejections] == [(152, "x"), (154, "Kaputt")]
    assert seen == sorted(seen)
    assert seen[-1] == path.stat().st_size


def test_progress_of_an_archive_counts_the_bytes_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "export.csv.gz"
    path.write_bytes(gzip.compress(TABLE.encode()))
    seen: list[int] = []
    read_export(path, progress=seen.append)
    assert seen[-1] <= path.stat().st_size


def test_a_file_of_one_endless_line_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "export.csv"
    path.write_bytes(b"1,2," * 100_000)
    with pytest.raises(ExportRefused, match="first line is longer than 262,144 bytes"):
        read_export(path)
    monkeypatch.setattr(encodings, "BLOCK_BYTES", 1000)
    path.write_bytes(TABLE.encode() * 100 + b"1,2," * 3000)
    with pytest.raises(ExportRefused, match="longer than 4,000 bytes"):
        read_export(path)


def test_a_stray_carriage_return_spoils_its_line_only(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_bytes(b"time,pv,op\n0,1,2\n1,1\r,2\n2,3,4\r\n3,5,6\n")
    export = read_export(path)
    assert export.record().t.tolist() == [0, 2, 3]
    assert [(r.line, r.reason) for r in export.accounting.rejections] == [
        (3, "it holds a carriage return")
    ]


def test_quotation_marks_in_strange_places(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text('time,pv,op\n0,1,2\n1,"1"x"",2\n2,3",4"\n3,"5",6\n4,7,"8\n')
    export = read_export(path)
    assert export.record().t.tolist()[0] == 0
    assert 3 in export.record().t.tolist()
    account = export.accounting
    assert account.rows_read == 5
    assert (6, "a quotation mark is not closed") in {(r.line, r.reason) for r in account.rejections}


def test_lines_are_counted_over_skipped_ones(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text("time,pv,op\n\n0,1,2\n\n\n* remark\n1,x,2\n[Section]\n2,y,2\n")
    export = read_export(path)
    assert [(r.line, r.text) for r in export.accounting.rejections] == [(7, "x"), (9, "y")]
    words = " ".join(export.decisions.words)
    assert "2 empty lines" in words
    assert "1 comments" in words
    assert "1 sections" in words


def test_ascii_is_recognised_by_its_bytes() -> None:
    assert keeps_ascii("utf-8")
    assert keeps_ascii("cp1252")
    assert not keeps_ascii("utf-16-le")
    assert not keeps_ascii("cp500")
    assert not keeps_ascii("undefined")


def test_line_ends_are_stated() -> None:
    for text, line_end in (("a\nb", "LF"), ("a\r\nb", "CRLF"), ("a\rb", "CR"), ("a", "LF")):
        assert decide_encoding(text.encode(), None).line_end == line_end


def test_decisions_need_only_the_start_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_bytes(TABLE.encode() + b"0,1,2\n" * 1_000_000)
    assert decide(path).columns == ("time", "Größe.PV", "Größe.OP")
