"""What the server answers to requests that are no session."""

import io
import json
import re

import numpy as np
import pytest
import trimesh
from serving import running

import facecode
from facecode.serve.access import Access
from facecode.serve.files import FILES


@pytest.fixture(scope="module")
def face():
    return facecode.load(threads=1)


@pytest.fixture(scope="module")
def served(face):
    with running(face) as server:
        yield server


def test_health_and_counts(served):
    assert served.get("healthz")[::2] == (200, b"ok\n")
    status, headers, body = served.get("metrics")
    assert status == 200
    assert headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
    assert b"facecode_sessions 0" in body


def test_the_page_and_its_parts(served):
    status, headers, body = served.get("")
    assert status == 200
    assert headers["content-type"].startswith("text/html")
    assert "default-src 'none'" in headers["content-security-policy"]
    parts = re.findall(r'(?:src|href)="([^":]+)"', body.decode())
    assert len(parts) == 8
    for name in parts:
        assert served.get(name)[0] == 200
    assert set(parts) <= set(FILES)


def test_the_page_names_no_other_machine(served):
    """Of its own; a source that is in no page was not looked at."""
    for name in FILES:
        if name.endswith((".js", ".css")) or not name:
            text = served.get(name)[2].decode()
            assert not re.findall(r"(?:https?|wss?):?//[\w.]", text), name


def test_no_other_file_is_given(served):
    for path in ("nothing", "../pyproject.toml", "%2e%2e/app.py", "live.html", "page/live.js"):
        assert served.get(path)[0] == 404


def test_what_the_page_offers(served, face):
    found = json.loads(served.get("face.json")[2])
    assert tuple(found["styles"]) == face.styles
    assert tuple(found["identities"]) == tuple(face.manifest.identities)
    assert (found["fps"], found["look_ahead_ms"]) == (30.0, 200)


def test_heads(served, face):
    status, headers, body = served.get("head.glb")
    assert (status, headers["content-type"]) == (200, "model/gltf-binary")
    name = list(face.manifest.identities)[1]
    other = served.get(f"head.glb?identity={name}")[2]
    shown = trimesh.load(io.BytesIO(other), file_type="glb").to_geometry().vertices
    wanted = face.bundle.identity(name) * face.manifest.metres_per_unit
    assert np.ptp(shown, axis=0).max() == pytest.approx(np.ptp(wanted, axis=0).max(), abs=1e-6)
    assert other != body
    for nobody in ("nobody", "../demo", "/etc/passwd", ""):
        assert served.get(f"head.glb?identity={nobody}")[0] == 404


def test_a_name_that_is_not_ours(served):
    """A page of anybody can give its name our address; the browser then asks under that name."""
    assert served.get("face.json", Host="evil.org")[0] == 400
    assert served.get("face.json", Host=f"localhost:{served.port}")[0] == 200


def test_tokens(face):
    with running(face, Access(token="s3cret")) as server:
        for path in ("metrics", "face.json", "head.glb"):
            assert server.get(path)[0] == 401
            assert server.get(path, Authorization="Bearer s3cret")[0] == 200
        assert server.get("")[0] == server.get("healthz")[0] == 200
