"""An upload on its way to disk: never held in memory, hashed as it comes, gone if it is cut off.

The framework's own form parser would answer a full disk as a bad request and take a body that was
cut off for a whole one.
"""

import hashlib
import re
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, BinaryIO, TypeAlias
from uuid import UUID, uuid4

from fastapi import Depends, Query, Request
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from service.access import Engineer
from service.database import Database, database
from service.errors import InvalidRequest
from service.loops.store import loop_with_id
from service.records.progress import Progress
from service.records.waiting import own_folder, uploads_folder

WRITE_BYTES = 1_000_000
MOST_PARTS = 60
LONGEST_FIELD = 10_000
LONGEST_NAME = 200
CUT_OFF = "The upload was cut off before its end; send it again."


@dataclass(frozen=True, slots=True, kw_only=True)
class Upload:
    """A file as it came.

    Attributes
    ----------
    path : Path
        Where it lies until the request is answered.
    file_name : str
        Name the sender gave it; only ever shown.
    sha256 : str
        Hash of its bytes, in hexadecimal.
    size : int
        Length. [byte]
    fields : mapping of str to tuple of str
        The other parts of the form.
    progress : Progress
        Tells the sender how far its work has come.
    """

    path: Path
    file_name: str
    sha256: str
    size: int
    fields: Mapping[str, tuple[str, ...]]
    progress: Progress


async def received(
    request: Request,
    loop_id: UUID,
    _: Engineer,
    held: Annotated[Database, Depends(database)],
    record_id: Annotated[
        UUID | None,
        Query(alias="id", description="Id of the record, to ask for its progress meanwhile."),
    ] = None,
) -> AsyncIterator[Upload]:
    """Take the file of a request in, after its loop is known to exist.

    Raises
    ------
    NotFound
        There is no such loop.
    InvalidRequest
        The body is no form with one file, or was cut off.
    """
    await run_in_threadpool(_must_exist, held, loop_id)
    folder = await run_in_threadpool(uploads_folder, request.app.state.settings.data)
    progress = Progress(folder, loop_id=loop_id, record_id=record_id or uuid4())
    # A folder of its own, and always the same name: the reader takes a name for a tag from it
    # where the file has none, and the same file must be read the same way again.
    with own_folder(folder) as own:
        path = own / "upload.csv"
        try:
            with path.open("xb", buffering=0) as file:
                form = _Form(_boundary(request))
                await _take_in(request, form, file, progress)
            yield Upload(
                path=path,
                file_name=form.file_name,
                sha256=form.hash.hexdigest(),
                size=form.size,
                fields={name: tuple(values) for name, values in form.fields.items()},
                progress=progress,
            )
        finally:
            progress.end()


Received: TypeAlias = Annotated[Upload, Depends(received, scope="function")]


def _must_exist(held: Database, loop_id: UUID) -> None:
    with held.readings() as session:
        loop_with_id(session, loop_id)


def _boundary(request: Request) -> bytes:
    kind, options = parse_options_header(request.headers.get("content-type"))
    if kind != b"multipart/form-data" or not options.get(b"boundary"):
        raise InvalidRequest(
            "header/Content-Type", "Send the file as multipart/form-data, in a part named file."
        )
    return options[b"boundary"]


async def _take_in(request: Request, form: "_Form", file: BinaryIO, progress: Progress) -> None:
    total = int(stated) if (stated := request.headers.get("content-length", "")).isdigit() else None
    taken = 0
    try:
        async for chunk in request.stream():
            form.parse(chunk)
            taken += len(chunk)
            if form.waiting_bytes >= WRITE_BYTES:
                await run_in_threadpool(form.write_to, file)
                progress.tell("receiving", taken, total)
    except ClientDisconnect as error:
        raise InvalidRequest("body", CUT_OFF) from error
    await run_in_threadpool(form.write_to, file)
    form.must_be_whole()


@dataclass(slots=True)
class _Part:
    """Headers of the part that comes in now."""

    name: str = ""
    headers: dict[bytes, bytes] = field(default_factory=dict)
    text: bytearray | None = None


class _Form:
    """Takes a form apart; the bytes of its file wait to be written."""

    def __init__(self, boundary: bytes) -> None:
        self.hash = hashlib.sha256()
        self.size = 0
        self.file_name = ""
        self.fields: dict[str, list[str]] = {}
        self.waiting_bytes = 0
        self._waiting: list[bytes] = []
        self._part = _Part()
        self._parts = 0
        self._files = 0
        self._header = (bytearray(), bytearray())
        self._ended = False
        try:
            self._parser = MultipartParser(
                boundary,
                {
                    "on_part_begin": self._begin,
                    "on_header_field": lambda data, start, end: self._on_header(0, data[start:end]),
                    "on_header_value": lambda data, start, end: self._on_header(1, data[start:end]),
                    "on_header_end": self._end_header,
                    "on_headers_finished": self._open,
                    "on_part_data": lambda data, start, end: self._on_data(data[start:end]),
                    "on_part_end": self._end,
                    "on_end": self._finish,
                },
            )
        except FormParserError as error:
            raise InvalidRequest("header/Content-Type", f"{error}.") from error

    def parse(self, chunk: bytes) -> None:
        """Take in the next bytes of the body."""
        try:
            self._parser.write(chunk)
        except FormParserError as error:
            raise InvalidRequest("body", f"This is no multipart form: {error}.") from error

    def write_to(self, file: BinaryIO) -> None:
        """Write and hash what has come in of the file."""
        for piece in self._waiting:
            self.hash.update(piece)
            left = memoryview(piece)
            while left:
                left = left[file.write(left) :]
        self._waiting.clear()
        self.waiting_bytes = 0

    def must_be_whole(self) -> None:
        """Refuse a body without an end or without a file."""
        if not self._ended:
            raise InvalidRequest("body", CUT_OFF)
        if not self._files:
            raise InvalidRequest("body/file", "There is no part named file with a file in it.")

    def _begin(self) -> None:
        self._part = _Part()
        self._parts += 1
        if self._parts > MOST_PARTS:
            raise InvalidRequest("body", f"The form has more than {MOST_PARTS} parts.")

    def _on_header(self, side: int, piece: bytes) -> None:
        self._header[side].extend(piece)

    def _end_header(self) -> None:
        name, value = self._header
        self._part.headers[bytes(name).lower()] = bytes(value)
        self._header = (bytearray(), bytearray())

    def _open(self) -> None:
        disposition = self._part.headers.get(b"content-disposition")
        _, options = parse_options_header(disposition)
        self._part.name = options.get(b"name", b"").decode("utf-8", "replace")
        if self._part.name != "file":
            self._part.text = bytearray()
            return
        self._files += 1
        if self._files > 1:
            raise InvalidRequest("body/file", "Send one file in a request.")
        self.file_name = harmless_name(options.get(b"filename", b"").decode("utf-8", "replace"))

    def _on_data(self, piece: bytes) -> None:
        if self._part.text is None:
            self._waiting.append(piece)
            self.waiting_bytes += len(piece)
            self.size += len(piece)
            return
        self._part.text += piece
        if len(self._part.text) > LONGEST_FIELD:
            raise InvalidRequest(
                f"body/{self._part.name[:50]}", f"This is longer than {LONGEST_FIELD} bytes."
            )

    def _end(self) -> None:
        if self._part.text is None:
            return
        try:
            text = self._part.text.decode("utf-8")
        except UnicodeDecodeError as error:
            raise InvalidRequest(
                f"body/{self._part.name[:50]}", "This is not text in UTF-8."
            ) from error
        self.fields.setdefault(self._part.name, []).append(text)

    def _finish(self) -> None:
        self._ended = True


def harmless_name(given: str) -> str:
    r"""Keep the last part of a path, one line of it, and not too much of that.

    Examples
    --------
    >>> harmless_name("..\\..\\etc/passwd")
    'passwd'
    >>> harmless_name("")
    'upload'
    """
    last = re.split(r"[/\\]", given)[-1]
    shown = "".join(character for character in last if character.isprintable()).strip()
    return shown[:LONGEST_NAME] if shown.strip(".") else "upload"
