"""From bytes to blocks of whole lines: byte-order mark, UTF-16, Latin-1, bare carriage returns."""

import codecs
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from historian.archives import LimitedReader
from historian.errors import ExportRefused

HEAD_BYTES = 256 * 1024
BLOCK_BYTES = 4 * 1024 * 1024

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoding:
    """How the bytes of a file become text.

    Attributes
    ----------
    name : str
        Name of the encoding, as Python knows it.
    mark : bytes
        Byte-order mark at the start of the file, possibly empty.
    line_end : str
        "LF", "CRLF" or "CR".
    words : str
        What was decided and why.
    """

    name: str
    mark: bytes
    line_end: str
    words: str


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Whole lines of a file, separated by LF or CRLF.

    Attributes
    ----------
    first_line : int
        Line number of the first one, counted from 1.
    data : bytes
        The lines, in UTF-8 or another encoding that keeps ASCII.
    terminated : bool
        Whether the last line has its line end.
    ends : ndarray of int64, shape (lines,)
        Where every line ends, after its line end.
    """

    first_line: int
    data: bytes
    terminated: bool
    ends: npt.NDArray[np.int64]


def decide_encoding(head: bytes, stated: str | None) -> Encoding:
    """Decide the encoding from the start of a file.

    Raises
    ------
    ExportRefused
        For an unknown encoding, or bytes that are no text.
    """
    mark, name = next(((mark, name) for mark, name in _MARKS if head.startswith(mark)), (b"", ""))
    if stated is not None:
        name, words = _stated(stated, name), f"{stated}, as stated"
    elif mark:
        words = f"{name.upper()}, from its byte-order mark"
    else:
        name, words = _from_pattern(head)
    try:
        text = head.removeprefix(mark).decode(name, errors="replace")
    except (LookupError, UnicodeError) as error:
        raise ExportRefused(f"The encoding {name!r} cannot read this file.") from error
    if "\n" in text:
        line_end = "CRLF" if "\r\n" in text else "LF"
    else:
        line_end = "CR" if "\r" in text else "LF"
    return Encoding(name=name, mark=mark, line_end=line_end, words=words)


def _stated(stated: str, of_mark: str) -> str:
    try:
        codec = codecs.lookup(stated).name
    except LookupError as error:
        raise ExportRefused(f"The encoding {stated!r} is not known to Python.") from error
    endless = codec in {"utf-16", "utf-32"} and of_mark.startswith(codec)
    return of_mark if endless else codec


def _from_pattern(head: bytes) -> tuple[str, str]:
    pairs = max(1, len(head) // 2)
    low, high = head[0::2].count(0) / pairs, head[1::2].count(0) / pairs
    if high > 0.4 and low < 0.1:
        return "utf-16-le", "UTF-16-LE, since every second byte is zero"
    if low > 0.4 and high < 0.1:
        return "utf-16-be", "UTF-16-BE, since every second byte is zero"
    if head.count(0) * 10 > len(head) * 9:
        raise ExportRefused("The file is mostly NUL bytes, not text; export it again.")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "latin-1", "Latin-1, since the bytes are not UTF-8"
    return "utf-8", "UTF-8"


def keeps_ascii(name: str) -> bool:
    """Tell whether ASCII text has the same bytes in an encoding."""
    sample = 'az09,;\t."\n'
    try:
        return sample.encode(name) == sample.encode("ascii")
    except UnicodeError:
        return False


def blocks(
    reader: LimitedReader,
    head: bytes,
    encoding: Encoding,
    progress: Callable[[int], None] | None = None,
) -> Iterator[Block]:
    """Walk through a file in blocks of whole lines.

    Parameters
    ----------
    reader : LimitedReader
        The rest of the file after `head`.
    head : bytes
        Bytes that were already read.
    encoding : Encoding
        How bytes become text.
    progress : callable, optional
        Told how far the file is read. [bytes]
    """
    line, rest = 1, b""
    for piece in _ascii_pieces(reader, head.removeprefix(encoding.mark), encoding):
        if progress is not None:
            progress(reader.position)
        cut = piece.rfind(b"\n") + 1
        if cut == 0:
            rest += piece
            if len(rest) > 4 * BLOCK_BYTES:
                raise ExportRefused(
                    f"The line is longer than {4 * BLOCK_BYTES:,} bytes; this is no table.",
                    line=line,
                )
            continue
        data = b"".join((rest, memoryview(piece)[:cut]))
        rest = piece[cut:]
        ends = _line_ends(data)
        yield Block(line, data, terminated=True, ends=ends)
        line += ends.size
    if rest:
        yield Block(line, rest, terminated=False, ends=np.array([len(rest)]))


def _line_ends(data: bytes) -> npt.NDArray[np.int64]:
    return np.flatnonzero(np.frombuffer(data, dtype=np.uint8) == ord("\n")) + 1


def _ascii_pieces(reader: LimitedReader, head: bytes, encoding: Encoding) -> Iterator[bytes]:
    """Yield bytes in which delimiters, digits and line ends are ASCII."""
    recode = None
    if not keeps_ascii(encoding.name):
        recode = codecs.getincrementaldecoder(encoding.name)(errors="replace")
    piece, final = head, False
    while not final:
        final = not piece
        plain = piece if recode is None else recode.decode(piece, final).encode("utf-8")
        if encoding.line_end == "CR":
            plain = plain.replace(b"\r", b"\n")
        if plain:
            yield plain
        piece = reader.read(BLOCK_BYTES)


def text_of(cell: bytes, encoding: Encoding) -> str:
    """Decode one cell; bytes that do not fit the encoding are read as Latin-1."""
    name = encoding.name if keeps_ascii(encoding.name) else "utf-8"
    try:
        return cell.decode(name)
    except UnicodeDecodeError:
        return cell.decode("latin-1")
