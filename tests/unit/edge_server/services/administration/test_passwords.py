"""Passwords are hashed slowly, with a salt, and never more than two at a time."""

import threading

import pytest

from edge_server.services.administration import passwords
from edge_server.services.errors import TooMuchError

PASSWORD = "nine words are better than one"


def test_a_hash_is_right_for_its_password_alone() -> None:
    stored = passwords.hashed(PASSWORD)
    assert stored != passwords.hashed(PASSWORD)  # Its salt
    assert stored.startswith("$argon2id$")
    assert passwords.is_right(PASSWORD, stored)
    assert not passwords.is_right(PASSWORD + " ", stored)


@pytest.mark.parametrize("stored", [None, "", "$argon2id$", "plain text", "\x00"])
def test_nothing_is_right_without_a_hash(stored: str | None) -> None:
    assert not passwords.is_right("", stored)
    assert not passwords.is_right(PASSWORD, stored)


def test_more_than_two_wait_and_are_refused_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    begun, released = threading.Semaphore(0), threading.Event()

    class Slow:
        def hash(self, _password: str) -> str:
            begun.release()
            released.wait(30.0)
            return "hash"

    monkeypatch.setattr(passwords, "_HASHER", Slow())
    monkeypatch.setattr(passwords, "TURN_WITHIN_S", 0.05)
    busy = [threading.Thread(target=passwords.hashed, args=(PASSWORD,)) for _ in range(2)]
    for thread in busy:
        thread.start()
        assert begun.acquire(timeout=30.0)
    with pytest.raises(TooMuchError):
        passwords.hashed(PASSWORD)
    released.set()
    for thread in busy:
        thread.join(30.0)
    assert passwords.hashed(PASSWORD) == "hash"
