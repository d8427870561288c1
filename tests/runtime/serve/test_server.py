"""Where the server listens."""

import socket

import pytest

pytest.importorskip("uvicorn")

from facecode.serve.errors import ListenError
from facecode.serve.server import listen, url_of


def test_a_free_port():
    with listen("127.0.0.1", 0) as listening:
        port = listening.getsockname()[1]
        assert url_of(listening) == f"http://127.0.0.1:{port}/"
        socket.create_connection(("127.0.0.1", port)).close()
        with pytest.raises(ListenError, match=f"port {port}.*--port"):
            listen("127.0.0.1", port)


@pytest.mark.parametrize(("host", "port"), [("127.0.0.1", 70000), ("203.0.113.9", 0), ("::x", 0)])
def test_addresses_that_are_none(host, port):
    with pytest.raises(ListenError, match="cannot listen"):
        listen(host, port)


def test_everybody_is_shown_an_address_that_opens():
    with listen("0.0.0.0", 0) as listening:
        assert url_of(listening).startswith("http://127.0.0.1:")
