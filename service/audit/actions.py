"""What users do with the audit trail: prove it and take it away."""

from collections.abc import Iterator

from sqlalchemy.orm import Session, sessionmaker

from service.audit import store
from service.audit.canonical import canonical
from service.audit.chain import Verdict, verify_chain

EXPORT_FORMAT = "loopwright-audit-1"
_BATCH = 1000


def verify(session: Session, *, known_head: str | None = None) -> Verdict:
    """Recompute every hash of the trail and say whether the chain is intact.

    Parameters
    ----------
    session : Session
        One moment of the database.
    known_head : str, optional
        A head hash from the log or an earlier export; only with one is it shown that nothing
        was cut off or written anew.
    """
    head = store.head(session)
    stated_lines, stated_hash = head.lines, head.hash
    return verify_chain(
        store.lines(session),
        known_head=known_head,
        stated_rows=stated_lines,
        stated_head=stated_hash,
    )


def export(readings: sessionmaker[Session]) -> tuple[str, Iterator[bytes]]:
    """Write the trail as JSON Lines: a first line with the head, then every line as it is hashed.

    Lines never change, so the export reads them in short transactions, up to the head it names.

    Returns
    -------
    str
        Head hash.
    iterator of bytes
        The export, piece by piece.
    """
    with readings() as session:
        end = store.head(session)
        rows, head = end.lines, end.hash

    def pieces() -> Iterator[bytes]:
        yield canonical({"format": EXPORT_FORMAT, "head": head, "rows": rows}) + b"\n"
        for first in range(1, rows + 1, _BATCH):
            with readings() as session:
                lines = store.lines_between(session, first, min(first + _BATCH - 1, rows))
            yield b"".join(canonical(line) + b"\n" for line in lines)

    return head, pieces()
