"""What a client may ask of the server, so that one never takes what belongs to the others."""

from __future__ import annotations

from dataclasses import dataclass

HELD_S = 2.0
"""Speech that is held for a session; beyond that its socket is not read."""
SLICE_S = 0.1
"""Speech that a session hears at once, before it is the turn of the next one."""
OPENING_S = 5.0
"""A client has this long to say what it wants."""
SEND_S = 10.0
"""A client has this long to take a message; then it is gone."""
UNOPENED = 32
"""Sockets that may be connected without having said what they want."""


@dataclass(frozen=True)
class Limits:
    """Limits that whoever runs the server chooses."""

    sessions: int
    """At once; one more is answered `busy`."""
    seconds: float = 600.0
    """A session ends after this time."""
    idle_s: float = 30.0
    """A session ends after this time without a message."""
    message_bytes: int = 256 * 1024
    """Of one message; 2.7 s of speech at 48 kHz."""
