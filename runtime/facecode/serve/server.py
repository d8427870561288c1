"""Listen on an address and serve, with limits where the application sees none."""

from __future__ import annotations

import socket

import uvicorn
from starlette.applications import Starlette

from facecode.serve.errors import ListenError
from facecode.serve.limits import SEND_S, Limits

BUFFER = 32 * 1024
"""Of the kernel, for each client and direction, so that one that stops reading is noticed within a
minute; the default holds ten minutes of frames."""
HIGHEST_PORT = 65535
REQUESTS = 64
"""At once, beside sessions."""


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens; port 0 picks a free one.

    Raises:
        ListenError
    """
    try:
        if not 0 <= port <= HIGHEST_PORT:  # the system would take the last 16 bits
            raise OverflowError(f"ports are 0 to {HIGHEST_PORT}")
        family, kind, proto, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        found = socket.socket(family, kind, proto)
        try:
            _prepare(found)
            found.bind(address)
            found.listen()
        except OSError:
            found.close()
            raise
    except (OSError, OverflowError) as error:
        raise ListenError(
            f"cannot listen on {host}, port {port}: {error}; choose others with --host and --port"
        ) from error
    return found


def _prepare(listening: socket.socket) -> None:
    """Options that the socket of each client inherits."""
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
        listening.setsockopt(socket.SOL_SOCKET, option, BUFFER)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux drops a peer that takes nothing for so long
        milliseconds = int(1000 * 2 * SEND_S)
        listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, milliseconds)


def url_of(listening: socket.socket) -> str:
    """The address to open in a browser."""
    host, port = listening.getsockname()[:2]
    name = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)
    return f"http://{name}:{port}/"


def server_of(app: Starlette, limits: Limits) -> uvicorn.Server:
    """The server of an application, for `run(sockets=[...])`."""
    config = uvicorn.Config(
        app,
        ws="websockets-sansio",
        ws_max_size=limits.message_bytes,
        # A pong would wait behind the speech that a fast client has sent. Who sends nothing is
        # idle, and who takes nothing is slow: the sessions see both.
        ws_ping_interval=None,
        ws_per_message_deflate=False,  # a small message must not become a large one
        limit_concurrency=limits.sessions + REQUESTS,
        timeout_graceful_shutdown=5,
        lifespan="off",
        log_config=None,
        access_log=False,
        log_level="warning",
        proxy_headers=False,
        server_header=False,
    )
    return uvicorn.Server(config)
