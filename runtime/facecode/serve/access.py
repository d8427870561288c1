"""Who may use the server: pages by their origin, clients by a token. Knows no socket."""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import urlsplit

from facecode.serve.errors import OriginError

LOOPBACK = ("localhost", "127.0.0.1", "[::1]")


@dataclass(frozen=True)
class Access:
    """Who may use the server."""

    host: str = "127.0.0.1"
    """The address that it listens on."""
    origins: tuple[str, ...] = ()
    """Pages that may use it beside its own, as `https://example.com`."""
    token: str | None = None
    """None: nobody is asked for one."""

    def __post_init__(self) -> None:
        for origin in self.origins:
            parts = urlsplit(origin)
            plain = f"{parts.scheme}://{parts.netloc}"
            if parts.scheme not in ("http", "https") or not parts.netloc or plain != origin:
                raise OriginError(f"got the origin {origin!r}; expected one as https://example.com")

    @property
    def is_local(self) -> bool:
        """Whether only this machine reaches the server."""
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @property
    def trusted_hosts(self) -> list[str]:
        """Names that requests may call the server by; any where it is open to others.

        Otherwise a page of anybody could give its own name the address 127.0.0.1.
        """
        if not self.is_local:
            return ["*"]
        return [*LOOPBACK, self.host, *(urlsplit(o).hostname or "" for o in self.origins)]

    def allows_origin(self, origin: str | None, host: str | None) -> bool:
        """Whether a page of `origin` may open a session; clients that are no browser send none.

        The server's own page may: its origin names what the request calls the server, `host`.
        """
        if origin is None or origin.lower() in self.origins:
            return True
        return host is not None and urlsplit(origin).netloc.lower() == host.lower()

    def allows(self, token: str | None) -> bool:
        """Whether `token` is the one."""
        if self.token is None:
            return True
        return hmac.compare_digest((token or "").encode(), self.token.encode())

    def allows_header(self, authorization: str | None) -> bool:
        """The same for a header `Authorization: Bearer TOKEN`."""
        scheme, _, token = (authorization or "").partition(" ")
        return self.allows(token if scheme.lower() == "bearer" else None)
