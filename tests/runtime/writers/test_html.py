"""The page: what it holds, without a browser; tests/clients opens it in one."""

import base64
import dataclasses
import io
import re

import numpy as np
import pytest
import soundfile
from gltf_reading import Glb
from small_faces import changed, cut, rigged, still, with_rig

from facecode.errors import EmptyClipError, NoFacesError
from facecode.writers.glb import GLB
from facecode.writers.html import HTML, write_blocks_html

SPOKEN = {"audio": np.sin(np.arange(3200, dtype=np.float32)), "sample_rate": 16000}


def written(write, *args):
    file = io.BytesIO()
    write(*args, file, *([False] if write in (HTML.write, HTML.write_takes) else []))
    return file.getvalue().decode()


def embedded(page, name):
    (found,) = re.findall(
        rf'<script type="application/octet-stream" id="{name}">(.*?)</script>', page
    )
    return base64.b64decode(found, validate=True)


def test_the_head_is_the_glb_and_the_sound_the_speech():
    clip = rigged(7, **SPOKEN)
    page = written(HTML.write, clip)
    glb = io.BytesIO()
    GLB.write(clip, glb, False)
    assert embedded(page, "head") == glb.getvalue()
    samples, rate = soundfile.read(io.BytesIO(embedded(page, "speech")), dtype="float32")
    assert rate == 16000
    assert np.abs(samples - clip.audio).max() <= 2**-15


def test_nothing_is_fetched_from_anywhere():
    page = written(HTML.write, rigged(7, **SPOKEN))
    assert "default-src 'none'" in page
    assert not re.search(r"https?://|src=|@import|fetch\(|XMLHttpRequest|import\(", page)
    assert "{{" not in page


def test_names_cannot_leave_their_place():
    odd = "</script><script>alert(1)</script>{{glb}}"
    clip = rigged(2)
    rig = type(clip.rig)((odd, *clip.rig.names[1:]), clip.rig.deltas)
    page = written(HTML.write, with_rig(clip, rig))
    assert "alert(1)" not in page
    names = Glb(embedded(page, "head")).tree["meshes"][0]["extras"]["targetNames"]
    assert names[0] == odd


def test_several_faces_and_no_sound():
    page = written(HTML.write_takes, [rigged(5), rigged(5)])
    assert len(Glb(embedded(page, "head")).tree["nodes"]) == 2
    assert embedded(page, "speech") == b""


def test_bytes_do_not_depend_on_the_blocks():
    clip = rigged(7)
    clip = dataclasses.replace(with_rig(clip, clip.rig), known_weights=clip.weights)
    file = io.BytesIO()
    write_blocks_html(still(clip), 7, cut(clip, [3, 4]), file)
    assert file.getvalue().decode() == written(HTML.write, clip)


def test_what_cannot_be_shown():
    with pytest.raises(EmptyClipError):
        written(HTML.write, still(rigged()))
    with pytest.raises(NoFacesError):
        written(HTML.write, changed(rigged(), faces=None))
