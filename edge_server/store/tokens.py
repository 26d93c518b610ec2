"""Which signatures of the cloud have been used; each is worth one effect."""

from sqlalchemy import Connection, delete, insert, select
from sqlalchemy.exc import IntegrityError

from edge_server.store.tables import spent_token


def spend(connection: Connection, jti: str, expires_at: float) -> bool:
    """Use a signature up; false when it was used before: then the transaction must not go on."""
    used = select(spent_token.c.jti).where(spent_token.c.jti == jti)
    if connection.execute(used).first() is not None:
        return False
    try:
        connection.execute(insert(spent_token), {"jti": jti, "expires_at": expires_at})
    except IntegrityError:  # Another server was faster
        return False
    return True


def forget_before(connection: Connection, moment: float) -> None:
    """Drop those that are refused for their age by now."""
    connection.execute(delete(spent_token).where(spent_token.c.expires_at < moment))
