"""What users do with records and samples."""

import hashlib
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from threading import Lock
from uuid import UUID

from sqlalchemy.orm import Session

from historian.csv_file import decide
from historian.sample_store import SampleStore, WriteResult
from service import audit
from service.actors import Actor
from service.database import Database
from service.errors import InvalidRequest
from service.loops.store import loop_with_id
from service.plain_json import dump_strictly, plain
from service.records import store
from service.records.export import LoopExport
from service.records.receiving import Upload
from service.records.schemas import UploadForm
from service.tables import RecordRow

LARGE = 20_000_000  # bytes; of larger files one is worked on at a time, so that memory stays
_ONE_LARGE = Lock()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredSamples:
    """An upload whose samples are in the sample store, not yet told to the database.

    Attributes
    ----------
    decisions_sha256 : str
        Hash of how the file is read.
    export : LoopExport
        The loop's part of the file.
    result : WriteResult
        What the store did with it.
    """

    decisions_sha256: str
    export: LoopExport
    result: WriteResult


def store_samples(
    held: Database, samples: SampleStore, *, loop_id: UUID, upload: Upload, max_bytes: int
) -> RecordRow | StoredSamples:
    """Read an upload and put its samples into the store, unless it is a record already.

    The samples go in first and the record after: killed in between, nothing tells of the upload,
    and sent again it changes nothing in the store. No transaction of the database waits meanwhile.

    Parameters
    ----------
    held : Database
        To look up the loop and records that are there.
    samples : SampleStore
        Takes the samples.
    loop_id : UUID
        Loop they belong to.
    upload : Upload
        The file and the form it came with.
    max_bytes : int
        Largest file, after unpacking. [byte]

    Raises
    ------
    ExportRefused, InvalidRequest, DiskFull, StoreBusy
        Nothing is stored.
    """
    form = UploadForm.of(upload.fields)
    options = form.options(max_bytes=max_bytes)
    with _turn(upload.size):
        decided = {
            "decisions": plain(decide(upload.path, options=options)),
            "form": form.model_dump(mode="json", exclude_defaults=True),
        }
        decisions_sha256 = _sha256(decided)
        with held.readings() as session:
            loop_tag = loop_with_id(session, loop_id).tag
            same = store.same_record(
                session, loop_id, sha256=upload.sha256, decisions_sha256=decisions_sha256
            )
            _must_be_free(session, upload.progress.record_id, same)
        if same is not None:
            return same
        export = LoopExport(
            upload.path,
            upload.size,
            options=options,
            tag=form.tag,
            loop_tag=loop_tag,
            start=form.start,
            progress=upload.progress,
        )
        try:
            result = samples.write(
                loop_id,
                export.samples(),
                progress=lambda done: upload.progress.tell("storing", done, export.rows),
            )
        except ValueError as error:
            raise InvalidRequest("body/file", f"{error}.") from error
    return StoredSamples(decisions_sha256=decisions_sha256, export=export, result=result)


def add_record(
    session: Session, *, actor: Actor, loop_id: UUID, upload: Upload, stored: StoredSamples
) -> tuple[RecordRow, bool]:
    """Tell the database of an upload whose samples are stored.

    Returns
    -------
    RecordRow
        The record.
    bool
        Whether it is new; somebody may have sent the same file at the same moment.
    """
    loop_with_id(session, loop_id, lock=True)
    same = store.same_record(
        session, loop_id, sha256=upload.sha256, decisions_sha256=stored.decisions_sha256
    )
    if same is not None:
        return same, False
    _must_be_free(session, upload.progress.record_id, None)
    changes = {
        name: count
        for name, count in asdict(stored.result).items()
        if name in ("new", "replaced", "unchanged", "repeated")
    }
    row = RecordRow(
        id=upload.progress.record_id,
        loop_id=loop_id,
        file_name=upload.file_name,
        sha256=upload.sha256,
        bytes=upload.size,
        decisions=stored.export.decisions(),
        decisions_sha256=stored.decisions_sha256,
        accounting={**stored.export.accounting(), "stored": changes},
        samples=stored.export.rows,
        first_time=stored.result.first,
        last_time=stored.result.last,
        state="stored",
        author=actor.owner,
    )
    session.add(row)
    session.flush()
    audit.record(
        session,
        actor=actor,
        action="record.stored",
        subject=f"loops/{loop_id}/records/{row.id}",
        loop_id=loop_id,
        after={
            "file_name": row.file_name,
            "sha256": row.sha256,
            "bytes": row.bytes,
            "samples": row.samples,
            "first_time": row.first_time,
            "last_time": row.last_time,
            "stored": changes,
        },
    )
    return row, True


def _turn(size: int) -> AbstractContextManager[object]:
    return _ONE_LARGE if size > LARGE else nullcontext()


def _sha256(value: object) -> str:
    return hashlib.sha256(dump_strictly(value).encode()).hexdigest()


def _must_be_free(session: Session, record_id: UUID, same: RecordRow | None) -> None:
    """Refuse an id that another record has; the id is chosen by the sender."""
    taken = session.get(RecordRow, record_id)
    if taken is not None and taken is not same:
        raise InvalidRequest("query/id", f"There is already another record {record_id}.")
