"""What a loop is worth to the plant, and within which limits its PV should stay."""

from collections.abc import Sequence

import sqlalchemy as sa
from alembic import op

revision: str = "9d24c7b1e05f"
down_revision: str | None = "5c1e6d0b9a37"
branch_labels: str | Sequence[str] | None = None
depends_on: str | Sequence[str] | None = None

COLUMNS = ("worth", "limit_low", "limit_high")


def upgrade() -> None:
    """Apply the change."""
    for name in COLUMNS:
        op.add_column("loop", sa.Column(name, sa.Double(), nullable=True))


def downgrade() -> None:
    """Take it back."""
    for name in reversed(COLUMNS):
        op.drop_column("loop", name)
