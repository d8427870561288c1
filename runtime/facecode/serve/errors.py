"""What the server refuses."""

from __future__ import annotations

from facecode.errors import FacecodeError


class ServeError(FacecodeError):
    """The server cannot do this."""


class ListenError(ServeError, OSError):
    """The server cannot listen on this address."""


class OriginError(ServeError, ValueError):
    """Not the origin of a page."""


class ProtocolError(ServeError, ValueError):
    """A message of a client that has no meaning."""
