"""Every database table in one place."""

from datetime import UTC, datetime
from uuid import UUID, uuid4

from sqlalchemy import (
    JSON,
    BigInteger,
    CheckConstraint,
    DateTime,
    Dialect,
    ForeignKey,
    ForeignKeyConstraint,
    Index,
    MetaData,
    String,
    TypeDecorator,
    UniqueConstraint,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

# JSON text, not JSONB: PostgreSQL would rewrite the numbers an audit hash was computed from.
JsonText = JSON(none_as_null=True)
# PostgreSQL otherwise sorts by the server's language, SQLite by code point: pages would differ.
SortedText = String().with_variant(String(collation="C"), "postgresql")


def now() -> datetime:
    """Tell the time in UTC."""
    return datetime.now(UTC)


class Instant(TypeDecorator[datetime]):
    """A moment in UTC, to the microsecond; SQLite itself would forget the time zone."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Store UTC, and refuse a time that does not say what it is."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError("a stored time must say its time zone")
        utc = value.astimezone(UTC)
        return utc.replace(tzinfo=None) if dialect.name == "sqlite" else utc

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Give UTC back."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if dialect.name == "sqlite" else value.astimezone(UTC)


class Table(DeclarativeBase):
    """Base of all tables, with predictable constraint names for migrations."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_N_name)s_%(referred_table_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map = {  # noqa: RUF012 - SQLAlchemy reads it from the class
        datetime: Instant,
        dict[str, object]: JsonText,
        list[str]: JsonText,
    }


class LoopRow(Table):
    """A control loop as the plant knows it, and the controller block that runs it."""

    __tablename__ = "loop"

    id: Mapped[UUID] = mapped_column(primary_key=True, default=uuid4)
    tag: Mapped[str] = mapped_column(SortedText, unique=True)
    description: Mapped[str]
    area: Mapped[str] = mapped_column(index=True)
    unit: Mapped[str] = mapped_column(index=True)
    pv_low: Mapped[float]
    pv_high: Mapped[float]
    pv_unit: Mapped[str]
    op_low: Mapped[float]
    op_high: Mapped[float]
    op_unit: Mapped[str]
    action: Mapped[str]
    form: Mapped[str]
    time_unit: Mapped[str]
    gain_basis: Mapped[str]
    sample_time: Mapped[float | None]
    profile: Mapped[str]
    largest_load: Mapped[float | None]
    kind: Mapped[str] = mapped_column(default="other")
    weight: Mapped[float] = mapped_column(default=1.0)
    worth: Mapped[float | None]
    limit_low: Mapped[float | None]
    limit_high: Mapped[float | None]
    archived: Mapped[bool] = mapped_column(default=False)
    version: Mapped[int] = mapped_column()
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[str]
    changed_at: Mapped[datetime] = mapped_column(default=now)

    __mapper_args__ = {"version_id_col": version}  # noqa: RUF012 - SQLAlchemy's own name


class RecordRow(Table):
    """One loop's part of an uploaded export: what was read, how, and what became of every row."""

    __tablename__ = "record"
    __table_args__ = (
        # The same file read the same way is the same record, however often it is sent.
        UniqueConstraint("loop_id", "sha256", "decisions_sha256"),
        CheckConstraint("state in ('pending', 'stored', 'failed')", name="state"),
    )

    id: Mapped[UUID] = mapped_column(primary_key=True, default=uuid4)
    loop_id: Mapped[UUID] = mapped_column(ForeignKey("loop.id"), index=True)
    file_name: Mapped[str]
    sha256: Mapped[str] = mapped_column(index=True)
    bytes: Mapped[int] = mapped_column(BigInteger)
    decisions: Mapped[dict[str, object]]
    decisions_sha256: Mapped[str]
    accounting: Mapped[dict[str, object]]
    samples: Mapped[int] = mapped_column(BigInteger)
    first_time: Mapped[datetime | None]
    last_time: Mapped[datetime | None]
    state: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)
    author: Mapped[str]


class ModelRow(Table):
    """A process model of a loop, identified from a record or typed in."""

    __tablename__ = "model"

    id: Mapped[UUID] = mapped_column(primary_key=True, default=uuid4)
    loop_id: Mapped[UUID] = mapped_column(ForeignKey("loop.id"), index=True)
    record_id: Mapped[UUID | None] = mapped_column(ForeignKey("record.id"), index=True)
    kind: Mapped[str | None]
    parameters: Mapped[dict[str, object] | None]
    verdict: Mapped[str]
    reasons: Mapped[list[str]]
    body: Mapped[dict[str, object]]
    created_at: Mapped[datetime] = mapped_column(default=now)
    author: Mapped[str]


class TuningRow(Table):
    """Every rule's settings for one process model, verified, and the one recommended."""

    __tablename__ = "tuning"

    id: Mapped[UUID] = mapped_column(primary_key=True, default=uuid4)
    loop_id: Mapped[UUID] = mapped_column(ForeignKey("loop.id"), index=True)
    model_id: Mapped[UUID | None] = mapped_column(ForeignKey("model.id"), index=True)
    process: Mapped[dict[str, object] | None]
    profile: Mapped[str]
    body: Mapped[dict[str, object]]
    recommended: Mapped[dict[str, object] | None]
    recommended_reason: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)
    author: Mapped[str]


class SheetRow(Table):
    """One version of a loop sheet. Never changed: the database refuses it."""

    __tablename__ = "sheet"

    loop_id: Mapped[UUID] = mapped_column(ForeignKey("loop.id"), primary_key=True)
    version: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    block: Mapped[dict[str, object]]
    settings: Mapped[dict[str, object]]
    model_id: Mapped[UUID | None] = mapped_column(ForeignKey("model.id"))
    tuning_id: Mapped[UUID | None] = mapped_column(ForeignKey("tuning.id"))
    process: Mapped[dict[str, object] | None]
    evidence: Mapped[dict[str, object] | None]
    profile: Mapped[str]
    reason: Mapped[str]
    author: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)


class SheetDecisionRow(Table):
    """What became of a draft. Never changed either.

    The key allows one decision a version, and `approval`, counted within the loop, makes two
    approvals at one moment impossible. The sheet with the highest approval is the current one;
    those below it are superseded, without a row being touched.
    """

    __tablename__ = "sheet_decision"
    __table_args__ = (
        ForeignKeyConstraint(["loop_id", "version"], ["sheet.loop_id", "sheet.version"]),
        UniqueConstraint("loop_id", "approval"),
        CheckConstraint("decision in ('approved', 'rejected', 'withdrawn')", name="decision"),
        CheckConstraint("(decision = 'approved') = (approval is not null)", name="approval"),
    )

    loop_id: Mapped[UUID] = mapped_column(primary_key=True)
    version: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    decision: Mapped[str]
    approval: Mapped[int | None]
    reason: Mapped[str]
    author: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)


class JobRow(Table):
    """Work that outlives the request that asked for it, and the process that does it."""

    __tablename__ = "job"
    __table_args__ = (
        CheckConstraint(
            "state in ('queued', 'running', 'done', 'failed', 'cancelled')", name="state"
        ),
        # Whoever looks for work reads the oldest of one state.
        Index("ix_job_state_created_at", "state", "created_at"),
    )

    id: Mapped[UUID] = mapped_column(primary_key=True, default=uuid4)
    kind: Mapped[str]
    # What must not be done twice, such as the daily assessment of one date.
    key: Mapped[str] = mapped_column(unique=True)
    request: Mapped[dict[str, object]]
    state: Mapped[str] = mapped_column(default="queued")
    cancel: Mapped[bool] = mapped_column(default=False)
    attempts: Mapped[int] = mapped_column(default=0)
    owner: Mapped[str | None]
    lease_until: Mapped[datetime | None]
    # How far it is: everything before `done` of `total` steps is stored.
    done: Mapped[int] = mapped_column(default=0)
    total: Mapped[int | None]
    message: Mapped[str] = mapped_column(default="")
    result: Mapped[dict[str, object] | None]
    created_at: Mapped[datetime] = mapped_column(default=now)
    started_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]
    author: Mapped[str]


class AssessmentRow(Table):
    """What the routine data of one period say about a loop, by one version of the method."""

    __tablename__ = "assessment"
    __table_args__ = (
        # A job that goes on after a kill stores no loop twice.
        UniqueConstraint("job_id", "loop_id"),
    )

    id: Mapped[UUID] = mapped_column(primary_key=True, default=uuid4)
    loop_id: Mapped[UUID] = mapped_column(ForeignKey("loop.id"), index=True)
    job_id: Mapped[UUID | None] = mapped_column(ForeignKey("job.id"))
    start: Mapped[datetime]
    end: Mapped[datetime] = mapped_column(index=True)
    method: Mapped[str]
    grade: Mapped[float | None]
    cause: Mapped[str]
    confidence: Mapped[str]
    body: Mapped[dict[str, object]]
    created_at: Mapped[datetime] = mapped_column(default=now)
    author: Mapped[str]


class OverruleRow(Table):
    """A person's diagnosis in place of the computed one, with the reason. Never changed."""

    __tablename__ = "overrule"

    id: Mapped[UUID] = mapped_column(primary_key=True, default=uuid4)
    assessment_id: Mapped[UUID] = mapped_column(ForeignKey("assessment.id"), index=True)
    cause: Mapped[str]
    reason: Mapped[str]
    author: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)


class KeyRow(Table):
    """An API key. The secret itself is known to its owner only."""

    __tablename__ = "api_key"
    __table_args__ = (
        CheckConstraint("role in ('viewer', 'engineer', 'approver', 'admin')", name="role"),
    )

    id: Mapped[str] = mapped_column(SortedText, primary_key=True)
    owner: Mapped[str]
    role: Mapped[str]
    secret_sha256: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=now)
    created_by: Mapped[str]
    revoked_at: Mapped[datetime | None]
    revoked_by: Mapped[str | None]


class AuditRow(Table):
    """Who changed what, when, from what to what, chained by hash. Append only."""

    __tablename__ = "audit"

    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    at: Mapped[datetime]
    actor: Mapped[str] = mapped_column(index=True)
    key_id: Mapped[str | None]
    action: Mapped[str] = mapped_column(index=True)
    subject: Mapped[str] = mapped_column(index=True)
    loop_id: Mapped[UUID | None] = mapped_column(index=True)
    before: Mapped[dict[str, object] | None]
    after: Mapped[dict[str, object] | None]
    previous: Mapped[str] = mapped_column(unique=True)
    hash: Mapped[str] = mapped_column(unique=True)


class AuditHeadRow(Table):
    """The end of the audit chain: the one row that writers queue up for."""

    __tablename__ = "audit_head"
    __table_args__ = (CheckConstraint("id = 1", name="single"),)

    id: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)
    lines: Mapped[int]
    hash: Mapped[str]
