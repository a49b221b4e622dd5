"""How far an upload has come, as a note beside the data that every worker process can read."""

import contextlib
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias
from uuid import UUID

from pydantic import Field

from service.schemas import Answer

Stage: TypeAlias = Literal["receiving", "reading", "storing"]

NOT_OFTENER = 0.2  # s
FORGOTTEN_AFTER = 900.0  # s without news, after which whoever wrote the note was killed


class ProgressBody(Answer):
    """How far an upload has come."""

    stage: Stage = Field(description="receiving and reading count bytes, storing counts samples.")
    done: int
    total: int | None = Field(description="null where it is not known beforehand.")


class Progress:
    """The note of one upload.

    Parameters
    ----------
    folder : Path
        Folder of uploads.
    loop_id, record_id : UUID
        Loop, and the id the record will have.
    """

    def __init__(self, folder: Path, *, loop_id: UUID, record_id: UUID) -> None:
        self.record_id = record_id
        self._loop_id = loop_id
        self._path = _note(folder, record_id)
        self._told = -NOT_OFTENER

    def tell(self, stage: Stage, done: int, total: int | None) -> None:
        """Note how far it is, unless that was noted just now."""
        now = time.monotonic()
        if now - self._told < NOT_OFTENER:
            return
        self._told = now
        note = {"loop_id": str(self._loop_id), "stage": stage, "done": done, "total": total}
        fresh = self._path.with_suffix(f".{os.getpid()}")
        # An upload does not fail for its note; a full disk will be said where it matters.
        with contextlib.suppress(OSError):
            fresh.write_text(json.dumps(note), "utf-8")
            fresh.replace(self._path)

    def counter(self, stage: Stage, total: int | None) -> Callable[[int], None]:
        """Give a function that notes a count of one stage."""
        return lambda done: self.tell(stage, done, total)

    def end(self) -> None:
        """Take the note away: the record itself tells from now on."""
        self._path.unlink(missing_ok=True)


def progress_of(data: Path, loop_id: UUID, record_id: UUID) -> ProgressBody | None:
    """Read the note of an upload that is under way."""
    path = _note(data / "uploads", record_id)
    try:
        forgotten = path.stat().st_mtime < time.time() - FORGOTTEN_AFTER
        note = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        return None
    if forgotten or note["loop_id"] != str(loop_id):
        return None
    return ProgressBody(stage=note["stage"], done=note["done"], total=note["total"])


def _note(folder: Path, record_id: UUID) -> Path:
    return folder / f"{record_id}.json"
