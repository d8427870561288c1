"""The page and its parts, and what the browser is told of them.

The head and its viewer are those of an .html; see `facecode.writers.html`.
"""

from __future__ import annotations

from pathlib import Path

from facecode.audio import SPEECH
from facecode.writers.html import PAGE

_HERE = Path(__file__).parent / "page"
FILES = {
    "": _HERE / "live.html",
    **{name: PAGE / name for name in ("page.css", "head.js", "viewer.js")},
    **{
        name: _HERE / name
        for name in ("live.css", "playout.js", "connection.js", "sources.js", "capture.js")
    },
    "live.js": _HERE / "live.js",
    "speech.flac": SPEECH,
}
"""By their path on the server."""
HEADERS = {
    # The page talks to its own server and to nobody else.
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "microphone=(self), camera=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",
}
