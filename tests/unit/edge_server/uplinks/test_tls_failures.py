"""A failed handshake is described by what is wrong, not by what usually is."""

import ssl

from edge_server.uplinks.tls_failures import describe


def test_a_certificate_that_is_not_the_pinned_one_is_said_to_be_another() -> None:
    error = ssl.SSLCertVerificationError("another certificate than the pinned one")
    assert describe("the broker", error) == (
        "the broker's certificate is not accepted: another certificate than the pinned one"
    )


def test_a_peer_that_ends_the_handshake_is_not_said_to_have_a_wrong_certificate() -> None:
    eof = ssl.SSLEOFError(ssl.SSL_ERROR_EOF, "EOF occurred in violation of protocol")
    assert describe("the broker", eof) == (
        "no TLS connection to the broker: EOF occurred in violation of protocol"
    )
