"""Jobs, assessments and what people said against them."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "5c1e6d0b9a37"
down_revision: str | None = "830a7c252cb5"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None


def upgrade() -> None:
    """Apply the change."""
    # Loops that are there already are of no stated kind, and none counts more than another.
    op.add_column("loop", sa.Column("kind", sa.String(), nullable=False, server_default="other"))
    op.add_column("loop", sa.Column("weight", sa.Double(), nullable=False, server_default="1"))
    op.create_table(
        "job",
        sa.Column("id", sa.Uuid(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("request", sa.JSON(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("cancel", sa.Boolean(), nullable=False),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("owner", sa.String(), nullable=True),
        sa.Column("lease_until", sa.DateTime(timezone=True), nullable=True),
        sa.Column("done", sa.Integer(), nullable=False),
        sa.Column("total", sa.Integer(), nullable=True),
        sa.Column("message", sa.String(), nullable=False),
        sa.Column("result", sa.JSON(), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("started_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("finished_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("author", sa.String(), nullable=False),
        sa.CheckConstraint(
            "state in ('queued', 'running', 'done', 'failed', 'cancelled')",
            name=op.f("ck_job_state"),
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_job")),
        sa.UniqueConstraint("key", name=op.f("uq_job_key")),
    )
    op.create_index("ix_job_state_created_at", "job", ["state", "created_at"], unique=False)
    op.create_table(
        "assessment",
        sa.Column("id", sa.Uuid(), nullable=False),
        sa.Column("loop_id", sa.Uuid(), nullable=False),
        sa.Column("job_id", sa.Uuid(), nullable=True),
        sa.Column("start", sa.DateTime(timezone=True), nullable=False),
        sa.Column("end", sa.DateTime(timezone=True), nullable=False),
        sa.Column("method", sa.String(), nullable=False),
        sa.Column("grade", sa.Double(), nullable=True),
        sa.Column("cause", sa.String(), nullable=False),
        sa.Column("confidence", sa.String(), nullable=False),
        sa.Column("body", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("author", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["job_id"], ["job.id"], name=op.f("fk_assessment_job_id_job")),
        sa.ForeignKeyConstraint(["loop_id"], ["loop.id"], name=op.f("fk_assessment_loop_id_loop")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_assessment")),
        sa.UniqueConstraint("job_id", "loop_id", name=op.f("uq_assessment_job_id_loop_id")),
    )
    op.create_index(op.f("ix_assessment_end"), "assessment", ["end"], unique=False)
    op.create_index(op.f("ix_assessment_loop_id"), "assessment", ["loop_id"], unique=False)
    op.create_table(
        "overrule",
        sa.Column("id", sa.Uuid(), nullable=False),
        sa.Column("assessment_id", sa.Uuid(), nullable=False),
        sa.Column("cause", sa.String(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("author", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["assessment_id"], ["assessment.id"], name=op.f("fk_overrule_assessment_id_assessment")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_overrule")),
    )
    op.create_index(op.f("ix_overrule_assessment_id"), "overrule", ["assessment_id"], unique=False)


def downgrade() -> None:
    """Take the change back."""
    op.drop_index(op.f("ix_overrule_assessment_id"), table_name="overrule")
    op.drop_table("overrule")
    op.drop_index(op.f("ix_assessment_loop_id"), table_name="assessment")
    op.drop_index(op.f("ix_assessment_end"), table_name="assessment")
    op.drop_table("assessment")
    op.drop_index("ix_job_state_created_at", table_name="job")
    op.drop_table("job")
    op.drop_column("loop", "weight")
    op.drop_column("loop", "kind")
