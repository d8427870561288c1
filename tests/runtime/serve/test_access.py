"""Who may use the server."""

import pytest

from facecode.serve.access import Access
from facecode.serve.errors import OriginError


@pytest.mark.parametrize(
    ("host", "local"),
    [
        ("127.0.0.1", True),
        ("localhost", True),
        ("::1", True),
        ("127.0.0.9", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.168.1.2", False),
        ("example.com", False),
    ],
)
def test_local(host, local):
    access = Access(host)
    assert access.is_local == local
    assert (access.trusted_hosts == ["*"]) != local


def test_origins():
    access = Access(origins=("https://example.com",))
    assert access.allows_origin(None, "127.0.0.1:8765")
    assert access.allows_origin("http://127.0.0.1:8765", "127.0.0.1:8765")
    assert access.allows_origin("https://example.com", "127.0.0.1:8765")
    assert not access.allows_origin("http://127.0.0.1:3000", "127.0.0.1:8765")
    assert not access.allows_origin("https://example.com.evil.org", "127.0.0.1:8765")
    assert not access.allows_origin("null", "127.0.0.1:8765")
    assert not access.allows_origin("http://x", None)
    assert "example.com" in access.trusted_hosts
    assert "evil.org" not in access.trusted_hosts


@pytest.mark.parametrize("origin", ["example.com", "https://example.com/", "*", "ftp://x", ""])
def test_origins_that_are_none(origin):
    with pytest.raises(OriginError, match="expected one as"):
        Access(origins=(origin,))


def test_tokens():
    assert Access().allows("")
    access = Access(token="pässword")
    assert access.allows("pässword")
    assert not any(access.allows(other) for other in ("", None, "password", "pässword "))
    assert access.allows_header("Bearer pässword")
    assert not access.allows_header("Basic pässword")
    assert not access.allows_header(None)
