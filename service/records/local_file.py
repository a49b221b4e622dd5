"""A file on the server itself, stored by the same actions as one that is uploaded."""

import hashlib
from collections.abc import Callable, Mapping
from contextlib import contextmanager
from pathlib import Path
from uuid import UUID, uuid4

from historian.sample_store import SampleStore
from service import database
from service.actors import Actor
from service.database import Database
from service.records import actions
from service.records.progress import Progress, Stage
from service.records.receiving import Upload, harmless_name
from service.records.waiting import uploads_folder
from service.settings import Settings
from service.tables import RecordRow

Teller = Callable[[Stage, int, int | None], None]

_writing = contextmanager(database.transaction)


class _Told(Progress):
    """Progress that goes to somebody in the same process."""

    def __init__(self, folder: Path, *, loop_id: UUID, record_id: UUID, teller: Teller) -> None:
        super().__init__(folder, loop_id=loop_id, record_id=record_id)
        self._teller = teller

    def tell(self, stage: Stage, done: int, total: int | None) -> None:
        """Pass on how far it is."""
        self._teller(stage, done, total)


def store_file(
    held: Database,
    samples: SampleStore,
    settings: Settings,
    *,
    actor: Actor,
    loop_id: UUID,
    file: Path,
    fields: Mapping[str, tuple[str, ...]],
    teller: Teller = lambda *_: None,
) -> tuple[RecordRow, bool]:
    """Read an export, put the loop's samples into the store, and keep the record.

    Parameters
    ----------
    held : Database
        Keeps the record.
    samples : SampleStore
        Takes the samples.
    settings : Settings
        Limits, and the folder of the installation.
    actor : Actor
        Who stores it.
    loop_id : UUID
        Loop the samples belong to.
    file : Path
        The export.
    fields : mapping of str to tuple of str
        What is stated about it, by the names of the upload's form.
    teller : callable
        Told the stage, how far it is and how far it goes.

    Returns
    -------
    RecordRow
        The record.
    bool
        Whether it is new; the same file read the same way is the same record.

    Raises
    ------
    RequestValidationError, InvalidRequest, ExportRefused, DiskFull, StoreBusy
        Nothing is stored.
    """
    upload = Upload(
        path=file,
        file_name=harmless_name(file.name),
        sha256=_sha256(file, teller),
        size=file.stat().st_size,
        fields=fields,
        progress=_Told(
            uploads_folder(settings.data), loop_id=loop_id, record_id=uuid4(), teller=teller
        ),
    )
    stored = actions.store_samples(
        held, samples, loop_id=loop_id, upload=upload, max_bytes=settings.max_upload_bytes
    )
    if isinstance(stored, RecordRow):
        return stored, False
    with _writing(held) as session:
        return actions.add_record(
            session, actor=actor, loop_id=loop_id, upload=upload, stored=stored
        )


def _sha256(file: Path, teller: Teller) -> str:
    hashed, done, size = hashlib.sha256(), 0, file.stat().st_size
    with file.open("rb") as source:
        while piece := source.read(1_000_000):
            hashed.update(piece)
            done += len(piece)
            teller("receiving", done, size)
    return hashed.hexdigest()
