"""Mission reports that may have reached the cloud are known: none is corrected behind them."""

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"


def upgrade() -> None:
    """Which reports were in flight before is not known."""
    column = sa.Column("sent", sa.Boolean, nullable=False, server_default=sa.false())
    op.add_column("outbox", column)


def downgrade() -> None:
    """The older version corrects every report that is here."""
    op.drop_column("outbox", "sent")
