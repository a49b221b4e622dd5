"""First tables."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

from service.triggers import create_statements, drop_statements

revision: str = "830a7c252cb5"
down_revision: str | None = None
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

SORTED_TEXT = sa.String().with_variant(sa.String(collation="C"), "postgresql")


def upgrade() -> None:
    """Apply the change."""
    op.create_table(
        "api_key",
        sa.Column("id", SORTED_TEXT, nullable=False),
        sa.Column("owner", sa.String(), nullable=False),
        sa.Column("role", sa.String(), nullable=False),
        sa.Column("secret_sha256", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("revoked_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("revoked_by", sa.String(), nullable=True),
        sa.CheckConstraint(
            "role in ('viewer', 'engineer', 'approver', 'admin')", name=op.f("ck_api_key_role")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_api_key")),
    )
    op.create_table(
        "audit",
        sa.Column("id", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("key_id", sa.String(), nullable=True),
        sa.Column("action", sa.String(), nullable=False),
        sa.Column("subject", sa.String(), nullable=False),
        sa.Column("loop_id", sa.Uuid(), nullable=True),
        sa.Column("before", sa.JSON(), nullable=True),
        sa.Column("after", sa.JSON(), nullable=True),
        sa.Column("previous", sa.String(), nullable=False),
        sa.Column("hash", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_audit")),
        sa.UniqueConstraint("hash", name=op.f("uq_audit_hash")),
        sa.UniqueConstraint("previous", name=op.f("uq_audit_previous")),
    )
    op.create_index(op.f("ix_audit_action"), "audit", ["action"], unique=False)
    op.create_index(op.f("ix_audit_actor"), "audit", ["actor"], unique=False)
    op.create_index(op.f("ix_audit_loop_id"), "audit", ["loop_id"], unique=False)
    op.create_index(op.f("ix_audit_subject"), "audit", ["subject"], unique=False)
    op.create_table(
        "audit_head",
        sa.Column("id", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("lines", sa.Integer(), nullable=False),
        sa.Column("hash", sa.String(), nullable=False),
        sa.CheckConstraint("id = 1", name=op.f("ck_audit_head_single")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_audit_head")),
    )
    op.create_table(
        "loop",
        sa.Column("id", sa.Uuid(), nullable=False),
        sa.Column("tag", SORTED_TEXT, nullable=False),
        sa.Column("description", sa.String(), nullable=False),
        sa.Column("area", sa.String(), nullable=False),
        sa.Column("unit", sa.String(), nullable=False),
        sa.Column("pv_low", sa.Double(), nullable=False),
        sa.Column("pv_high", sa.Double(), nullable=False),
        sa.Column("pv_unit", sa.String(), nullable=False),
        sa.Column("op_low", sa.Double(), nullable=False),
        sa.Column("op_high", sa.Double(), nullable=False),
        sa.Column("op_unit", sa.String(), nullable=False),
        sa.Column("action", sa.String(), nullable=False),
        sa.Column("form", sa.String(), nullable=False),
        sa.Column("time_unit", sa.String(), nullable=False),
        sa.Column("gain_basis", sa.String(), nullable=False),
        sa.Column("sample_time", sa.Double(), nullable=True),
        sa.Column("profile", sa.String(), nullable=False),
        sa.Column("largest_load", sa.Double(), nullable=True),
        sa.Column("archived", sa.Boolean(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("changed_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_loop")),
        sa.UniqueConstraint("tag", name=op.f("uq_loop_tag")),
    )
    op.create_index(op.f("ix_loop_area"), "loop", ["area"], unique=False)
    op.create_index(op.f("ix_loop_unit"), "loop", ["unit"], unique=False)
    op.create_table(
        "record",
        sa.Column("id", sa.Uuid(), nullable=False),
        sa.Column("loop_id", sa.Uuid(), nullable=False),
        sa.Column("file_name", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(), nullable=False),
        sa.Column("bytes", sa.BigInteger(), nullable=False),
        sa.Column("decisions", sa.JSON(), nullable=False),
        sa.Column("decisions_sha256", sa.String(), nullable=False),
        sa.Column("accounting", sa.JSON(), nullable=False),
        sa.Column("samples", sa.BigInteger(), nullable=False),
        sa.Column("first_time", sa.DateTime(timezone=True), nullable=True),
        sa.Column("last_time", sa.DateTime(timezone=True), nullable=True),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("author", sa.String(), nullable=False),
        sa.CheckConstraint(
            "state in ('pending', 'stored', 'failed')", name=op.f("ck_record_state")
        ),
        sa.ForeignKeyConstraint(["loop_id"], ["loop.id"], name=op.f("fk_record_loop_id_loop")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_record")),
        sa.UniqueConstraint(
            "loop_id",
            "sha256",
            "decisions_sha256",
            name=op.f("uq_record_loop_id_sha256_decisions_sha256"),
        ),
    )
    op.create_index(op.f("ix_record_loop_id"), "record", ["loop_id"], unique=False)
    op.create_index(op.f("ix_record_sha256"), "record", ["sha256"], unique=False)
    op.create_table(
        "model",
        sa.Column("id", sa.Uuid(), nullable=False),
        sa.Column("loop_id", sa.Uuid(), nullable=False),
        sa.Column("record_id", sa.Uuid(), nullable=True),
        sa.Column("kind", sa.String(), nullable=True),
        sa.Column("parameters", sa.JSON(), nullable=True),
        sa.Column("verdict", sa.String(), nullable=False),
        sa.Column("reasons", sa.JSON(), nullable=False),
        sa.Column("body", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("author", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["loop_id"], ["loop.id"], name=op.f("fk_model_loop_id_loop")),
        sa.ForeignKeyConstraint(
            ["record_id"], ["record.id"], name=op.f("fk_model_record_id_record")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_model")),
    )
    op.create_index(op.f("ix_model_loop_id"), "model", ["loop_id"], unique=False)
    op.create_index(op.f("ix_model_record_id"), "model", ["record_id"], unique=False)
    op.create_table(
        "tuning",
        sa.Column("id", sa.Uuid(), nullable=False),
        sa.Column("loop_id", sa.Uuid(), nullable=False),
        sa.Column("model_id", sa.Uuid(), nullable=True),
        sa.Column("process", sa.JSON(), nullable=True),
        sa.Column("profile", sa.String(), nullable=False),
        sa.Column("body", sa.JSON(), nullable=False),
        sa.Column("recommended", sa.JSON(), nullable=True),
        sa.Column("recommended_reason", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("author", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["loop_id"], ["loop.id"], name=op.f("fk_tuning_loop_id_loop")),
        sa.ForeignKeyConstraint(["model_id"], ["model.id"], name=op.f("fk_tuning_model_id_model")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_tuning")),
    )
    op.create_index(op.f("ix_tuning_loop_id"), "tuning", ["loop_id"], unique=False)
    op.create_index(op.f("ix_tuning_model_id"), "tuning", ["model_id"], unique=False)
    op.create_table(
        "sheet",
        sa.Column("loop_id", sa.Uuid(), nullable=False),
        sa.Column("version", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("block", sa.JSON(), nullable=False),
        sa.Column("settings", sa.JSON(), nullable=False),
        sa.Column("model_id", sa.Uuid(), nullable=True),
        sa.Column("tuning_id", sa.Uuid(), nullable=True),
        sa.Column("process", sa.JSON(), nullable=True),
        sa.Column("evidence", sa.JSON(), nullable=True),
        sa.Column("profile", sa.String(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("author", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["loop_id"], ["loop.id"], name=op.f("fk_sheet_loop_id_loop")),
        sa.ForeignKeyConstraint(["model_id"], ["model.id"], name=op.f("fk_sheet_model_id_model")),
        sa.ForeignKeyConstraint(
            ["tuning_id"], ["tuning.id"], name=op.f("fk_sheet_tuning_id_tuning")
        ),
        sa.PrimaryKeyConstraint("loop_id", "version", name=op.f("pk_sheet")),
    )
    op.create_table(
        "sheet_decision",
        sa.Column("loop_id", sa.Uuid(), nullable=False),
        sa.Column("version", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("decision", sa.String(), nullable=False),
        sa.Column("approval", sa.Integer(), nullable=True),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("author", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint(
            "(decision = 'approved') = (approval is not null)",
            name=op.f("ck_sheet_decision_approval"),
        ),
        sa.CheckConstraint(
            "decision in ('approved', 'rejected', 'withdrawn')",
            name=op.f("ck_sheet_decision_decision"),
        ),
        sa.ForeignKeyConstraint(
            ["loop_id", "version"],
            ["sheet.loop_id", "sheet.version"],
            name=op.f("fk_sheet_decision_loop_id_version_sheet"),
        ),
        sa.PrimaryKeyConstraint("loop_id", "version", name=op.f("pk_sheet_decision")),
        sa.UniqueConstraint("loop_id", "approval", name=op.f("uq_sheet_decision_loop_id_approval")),
    )
    op.execute("INSERT INTO audit_head (id, lines, hash) VALUES (1, 0, '" + "0" * 64 + "')")
    for statement in create_statements(op.get_bind().dialect.name):
        op.execute(statement)


def downgrade() -> None:
    """Take the change back."""
    for statement in drop_statements(op.get_bind().dialect.name):
        op.execute(statement)
    op.drop_table("sheet_decision")
    op.drop_table("sheet")
    op.drop_index(op.f("ix_tuning_model_id"), table_name="tuning")
    op.drop_index(op.f("ix_tuning_loop_id"), table_name="tuning")
    op.drop_table("tuning")
    op.drop_index(op.f("ix_model_record_id"), table_name="model")
    op.drop_index(op.f("ix_model_loop_id"), table_name="model")
    op.drop_table("model")
    op.drop_index(op.f("ix_record_sha256"), table_name="record")
    op.drop_index(op.f("ix_record_loop_id"), table_name="record")
    op.drop_table("record")
    op.drop_index(op.f("ix_loop_unit"), table_name="loop")
    op.drop_index(op.f("ix_loop_area"), table_name="loop")
    op.drop_table("loop")
    op.drop_table("audit_head")
    op.drop_index(op.f("ix_audit_subject"), table_name="audit")
    op.drop_index(op.f("ix_audit_loop_id"), table_name="audit")
    op.drop_index(op.f("ix_audit_actor"), table_name="audit")
    op.drop_index(op.f("ix_audit_action"), table_name="audit")
    op.drop_table("audit")
    op.drop_table("api_key")
