"""Open the file as it came: plain, gzip or zip, never more than the limit, never a disguise."""

import gzip
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Protocol

from historian.errors import ExportRefused, ExportTooLarge

_DISGUISES = (
    (b"%PDF", "a PDF document; export the trend as CSV text"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook; save the sheet as CSV"),
    (b"PAR1", "a Parquet file; export CSV text"),
    (b"SQLite format 3", "an SQLite database; export the table as CSV"),
    (b"\x89PNG", "a picture; export the samples as CSV"),
    (b"\xff\xd8\xff", "a picture; export the samples as CSV"),
    (b"{\\rtf", "a rich-text document; save it as plain text"),
    (b"BZh", "a bzip2 archive; unpack it, or use gzip or zip"),
    (b"\xfd7zXZ", "an xz archive; unpack it, or use gzip or zip"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive; unpack it, or use gzip or zip"),
    (b"Rar!", "a RAR archive; unpack it, or use gzip or zip"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive; unpack it, or use gzip or zip"),
)
_MARKUP = (b"<!doctype", b"<html", b"<?xml", b"<table")


DAMAGE = (EOFError, zlib.error, zipfile.BadZipFile, gzip.BadGzipFile, OSError)


def _damaged(error: Exception) -> ExportRefused:
    return ExportRefused(
        f"The file cannot be read to its end, it is damaged or cut off ({error}); export it again."
    )


class ReadsBytes(Protocol):
    """Anything that bytes can be read from."""

    def read(self, size: int, /) -> bytes:
        """Read up to `size` bytes."""


class LimitedReader:
    """Read bytes and refuse to read more than a limit, so that a bomb cannot go off."""

    def __init__(self, raw: ReadsBytes, file: IO[bytes], limit: int, *, unpacked: bool) -> None:
        self._raw = raw
        self._file = file
        self._limit = limit
        self._unpacked = unpacked
        self._taken = 0

    @property
    def position(self) -> int:
        """How far the file itself is read. [bytes]"""
        return self._file.tell()

    def read(self, size: int) -> bytes:
        """Read up to `size` bytes.

        Raises
        ------
        ExportTooLarge
            When the total passes the limit.
        ExportRefused
            When an archive is damaged or cut off.
        """
        try:
            piece = self._raw.read(size)
        except DAMAGE as error:
            raise _damaged(error) from error
        self._taken += len(piece)
        if self._taken > self._limit:
            raise ExportTooLarge(self._limit, unpacked=self._unpacked)
        return piece


@contextmanager
def opened(path: Path, limit: int) -> Iterator[tuple[LimitedReader, str]]:
    """Open an export and say what it was packed in.

    Parameters
    ----------
    path : Path
        The file.
    limit : int
        Largest size after unpacking. [bytes]

    Yields
    ------
    reader : LimitedReader
        The unpacked bytes.
    container : str
        "plain", "gzip" or "zip: name of the member".

    Raises
    ------
    ExportRefused
        For an empty file, a directory, a disguised document or an archive of several files.
    """
    try:
        size = path.stat().st_size
        file = path.open("rb")
    except OSError as error:
        raise ExportRefused(f"The file cannot be opened: {error.strerror}.") from error
    with file:
        start = file.read(1024)
        file.seek(0)
        if size == 0:
            raise ExportRefused("The file is empty (0 bytes); export it again.")
        if start.startswith(b"\x1f\x8b"):
            with gzip.GzipFile(fileobj=file) as unpacked:
                yield LimitedReader(unpacked, file, limit, unpacked=True), "gzip"
        elif start.startswith((b"PK\x03\x04", b"PK\x05\x06")):
            with _only_member(file) as (member, name):
                yield LimitedReader(member, file, limit, unpacked=True), f"zip: {name}"
        else:
            _refuse_disguise(start)
            if size > limit:
                raise ExportTooLarge(limit, unpacked=False)
            yield LimitedReader(file, file, limit, unpacked=False), "plain"


def _refuse_disguise(start: bytes) -> None:
    for magic, what in _DISGUISES:
        if start.startswith(magic):
            raise ExportRefused(f"The file is not CSV but {what}.")
    text = start.removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    if text.startswith(_MARKUP):
        raise ExportRefused("The file is not CSV but HTML or XML; export the samples as CSV.")
    if text.startswith((b'{"', b"{ ", b"{\n", b"{\r", b"[{", b"[\n", b"[\r")):
        raise ExportRefused("The file is not CSV but JSON; export the samples as CSV.")


@contextmanager
def _only_member(file: IO[bytes]) -> Iterator[tuple[IO[bytes], str]]:
    try:
        archive = zipfile.ZipFile(file)
    except zipfile.BadZipFile as error:
        raise ExportRefused(
            f"The zip archive is damaged or cut off ({error}); pack it again."
        ) from error
    with archive:
        names = [name for name in archive.namelist() if not name.endswith("/")]
        if any(name in {"[Content_Types].xml", "mimetype"} for name in names):
            raise ExportRefused("The file is not CSV but a workbook; save the sheet as CSV.")
        names = [name for name in names if not name.startswith("__MACOSX/")]
        if len(names) != 1:
            raise ExportRefused(
                f"The zip archive holds {len(names)} files; send one export in an archive."
            )
        try:
            member = archive.open(names[0])
        except (RuntimeError, NotImplementedError, zipfile.BadZipFile) as error:
            raise ExportRefused(
                f"The member {names[0]!r} of the zip archive cannot be read ({error}); pack it "
                "again without a password."
            ) from error
        with member:
            try:
                start = member.read(1024)
                member.seek(0)
            except DAMAGE as error:
                raise _damaged(error) from error
            _refuse_disguise(start)
            yield member, names[0]
