"""People sign in: accounts, sessions, links that sign in once."""

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"


def upgrade() -> None:
    """Begin without accounts; `edge_server users` creates the first."""
    op.create_table(
        "account",
        sa.Column("name", sa.String(64), primary_key=True),
        sa.Column("role", sa.String(10), nullable=False),
        sa.Column("password", sa.String(200)),
        sa.Column("created_at", sa.Float, nullable=False),
        sa.Column("signed_in_at", sa.Float),
        sa.Column("is_disabled", sa.Boolean, nullable=False, server_default=sa.false()),
    )
    op.create_table(
        "session",
        sa.Column("prefix", sa.String(8), primary_key=True),
        sa.Column("sha256", sa.LargeBinary(32), nullable=False),
        _account(),
        sa.Column("created_at", sa.Float, nullable=False),
        sa.Column("expires_at", sa.Float, nullable=False),
        sa.Column("address", sa.String(64), nullable=False),
    )
    op.create_index("ix_session_account", "session", ["account"])
    op.create_index("ix_session_expires_at", "session", ["expires_at"])
    op.create_table(
        "sign_in_link",
        sa.Column("sha256", sa.LargeBinary(32), primary_key=True),
        _account(),
        sa.Column("expires_at", sa.Float, nullable=False),
    )
    op.create_index("ix_sign_in_link_expires_at", "sign_in_link", ["expires_at"])


def downgrade() -> None:
    """The older version knows keys alone."""
    for table in ("sign_in_link", "session", "account"):
        op.drop_table(table)


def _account() -> sa.Column[str]:
    owner = sa.ForeignKey("account.name", ondelete="CASCADE")
    return sa.Column("account", sa.String(64), owner, nullable=False)
