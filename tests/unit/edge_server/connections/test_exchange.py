"""An exchange knows whether its client still waits for the answer."""

import socket
import struct

import pytest

from edge_server.connections.exchange import Exchange
from edge_server.connections.framing import FramedRequest


def exchange_of(server: socket.socket) -> Exchange:
    server.settimeout(0.0)  # As the loop leaves it
    request = FramedRequest(b"", is_whole=True)
    return Exchange(server, ("192.0.2.1", 5), ("192.0.2.2", 80), request)


def connected() -> tuple[socket.socket, socket.socket]:
    """Return both ends of a TCP connection: the client's and the server's."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        client = socket.create_connection(listener.getsockname())
        return client, listener.accept()[0]


def test_a_client_that_waits_is_connected_also_while_it_sends_the_next_request() -> None:
    client, server = connected()
    with client, server:
        exchange = exchange_of(server)
        assert exchange.is_connected
        client.sendall(b"GET")
        assert exchange.is_connected
        assert server.recv(3) == b"GET"


@pytest.mark.parametrize("linger_s", [None, 0])
def test_a_client_that_has_ended_is_not_connected(linger_s: int | None) -> None:
    client, server = connected()
    with server:
        if linger_s is not None:  # Its end is a reset
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, linger_s))
        client.close()
        assert not exchange_of(server).is_connected


def test_a_socket_that_is_closed_here_is_not_connected() -> None:
    client, server = connected()
    with client:
        exchange = exchange_of(server)
        server.close()
        assert not exchange.is_connected
