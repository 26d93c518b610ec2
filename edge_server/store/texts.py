"""How text goes to PostgreSQL: as it is, but for a NUL, which its text cannot hold.

A vehicle's message with a NUL is kept with U+FFFD in its place; one in an address finds nothing.
The JSON that goes to the cloud is not touched: there a NUL is written as an escape.
"""

from psycopg.abc import Buffer
from psycopg.types.string import StrDumper


class TextDumper(StrDumper):
    """Writes a text without NUL."""

    def dump(self, obj: str) -> Buffer | None:
        """Give the bytes of a text."""
        return super().dump(obj.replace("\0", "\ufffd"))
