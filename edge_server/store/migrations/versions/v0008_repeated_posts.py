"""A repeated POST is known by its key and who sent it, and gets the answer that was given first."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"

_ID = sa.BigInteger().with_variant(sa.Integer(), "sqlite")
_COPIED = "key, route, body_sha256, object_id, message_id, created_at"


def upgrade() -> None:
    """Whose key it was is not known; each role had one that bears the role's name, most likely."""
    _replace(
        sa.Column("owner", sa.String(80), primary_key=True),
        "owner",
        "role || '/' || role",
        sa.Column("answer", sa.Text),
    )


def downgrade() -> None:
    """Of several owners of one key the older version can keep one."""
    op.execute(
        "DELETE FROM idempotency WHERE EXISTS (SELECT 1 FROM idempotency AS other "
        "WHERE other.key = idempotency.key AND other.owner < idempotency.owner)"
    )
    role = (
        "CASE instr(owner, '/') WHEN 0 THEN owner ELSE substr(owner, 1, instr(owner, '/') - 1) END"
    )
    if op.get_bind().dialect.name == "postgresql":
        role = "split_part(owner, '/', 1)"
    _replace(sa.Column("role", sa.String(10), primary_key=True), "role", role)


def _replace(owner: sa.Column[str], name: str, value: str, *more: sa.Column[str]) -> None:
    """Make the table anew, for a part of its primary key changes."""
    op.execute(
        f"CREATE TABLE copied AS SELECT {_COPIED}, {value} AS {name} FROM idempotency"  # noqa: S608  # constants of this file
    )
    op.drop_table("idempotency")
    op.create_table(
        "idempotency",
        sa.Column("key", sa.String(64), primary_key=True),
        owner,
        sa.Column("route", sa.String(20), nullable=False),
        sa.Column("body_sha256", sa.LargeBinary(32), nullable=False),
        sa.Column("object_id", _ID, nullable=False),
        sa.Column("message_id", sa.String(26)),
        sa.Column("created_at", sa.Float, nullable=False),
        *more,
    )
    op.create_index("ix_idempotency_created_at", "idempotency", ["created_at"])
    op.execute(
        f"INSERT INTO idempotency ({_COPIED}, {name}) SELECT {_COPIED}, {name} FROM copied"  # noqa: S608  # as above
    )
    op.drop_table("copied")
