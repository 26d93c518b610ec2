"""Events as work, and what is kept of them; boundaries of fields."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"

_ID = sa.BigInteger().with_variant(sa.Integer(), "sqlite")

_BEFORE = "kind IN ('mission', 'latest_state_vector')"
_AFTER = "kind IN ('mission', 'latest_state_vector', 'event')"


def upgrade() -> None:
    """Let events be work, and make the new tables."""
    _change_kinds(_BEFORE, _AFTER)
    op.create_table(
        "event",
        sa.Column("id", _ID, primary_key=True),
        sa.Column(
            "work",
            _ID,
            sa.ForeignKey("work.id", ondelete="CASCADE"),
            nullable=False,
            unique=True,
        ),
        sa.Column("received_at", sa.Float, nullable=False),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "field",
        sa.Column("id", _ID, primary_key=True),
        sa.Column("body", sa.Text, nullable=False),
        sa.Column("received_at", sa.Float, nullable=False),
        sa.Column("updated_at", sa.Float, nullable=False),
        sqlite_autoincrement=True,
    )


def downgrade() -> None:
    """The older version knows no events, so they go."""
    op.drop_table("field")
    op.drop_table("event")
    op.execute("DELETE FROM work WHERE kind = 'event'")
    _change_kinds(_AFTER, _BEFORE)


def _change_kinds(before: str, after: str) -> None:
    """Put another rule in the place of the one that says which kinds there are."""
    if op.get_bind().dialect.name != "sqlite":
        op.execute("ALTER TABLE work DROP CONSTRAINT ck_work_kind")
        op.execute(f"ALTER TABLE work ADD CONSTRAINT ck_work_kind CHECK ({after})")
        return
    # SQLite cannot change a rule, and a copied table would take its commands with it when the
    # old one is dropped; a rule is only text there (lang_altertable.html, section 7).
    connection = op.get_bind()
    version = connection.execute(sa.text("PRAGMA schema_version")).scalar_one()
    op.execute("PRAGMA writable_schema = ON")
    connection.execute(
        sa.text(
            "UPDATE sqlite_master SET sql = replace(sql, :before, :after) "
            "WHERE type = 'table' AND name = 'work'"
        ),
        {"before": before, "after": after},
    )
    op.execute(f"PRAGMA schema_version = {version + 1}")
    op.execute("PRAGMA writable_schema = OFF")
