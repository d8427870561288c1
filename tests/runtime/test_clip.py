"""What a clip, and what is made of clips, says of itself in one line."""

import dataclasses

import numpy as np
import pytest
from small_faces import changed, rigged

import facecode
from facecode.errors import NoVerticesError
from facecode.live.frame import LiveFrame


@pytest.fixture
def clip(tiny, speech):
    return tiny.animate(speech[0][:16_000], sample_rate=speech[1], mode="window")


def test_a_clip_in_one_line(clip):
    n, v = clip.n_frames, len(clip.template)
    parts = ", ".join(f"{name} {width}" for name, width in clip.parts.items())
    assert repr(clip) == (
        f"<Animation: {n} frames at {clip.fps:g} fps ({n / clip.fps:.2f} s), {v} vertices, "
        f"codes: {parts}, no face units, window mode>"
    )
    assert repr(facecode.Takes((clip, clip))) == f"<Takes: 2 faces, each {repr(clip)[12:]}"


def test_what_is_not_known_is_left_out():
    clip = rigged(1, fps=25.0)
    said = f"1 frames at 25 fps (0.04 s), {len(clip.template)} vertices, 4 face units"
    assert repr(clip) == f"<RiggedClip: {said}>"
    assert repr(clip.rig) == f"<Rig: 4 units of {len(clip.template)} vertices>"
    assert repr(changed(clip, rig=None)).endswith("vertices, no face units>")


def test_a_clip_of_weights_alone_says_so():
    clip = rigged()
    alone = dataclasses.replace(clip, offsets=clip.offsets[:, :0])
    assert not alone.has_vertices
    assert "vertices (weights alone)," in repr(alone)
    with pytest.raises(NoVerticesError):
        _ = alone.vertices


def test_blocks_count_all_their_frames(tiny, speech):
    blocks = tiny.blocks(speech[0][:32_000], sample_rate=speech[1], mode="window")
    assert repr(blocks).startswith(f"<Blocks: {blocks.n_frames} frames at ")


def test_a_bundle_in_one_line(tiny):
    said = repr(tiny.bundle)
    assert str(tiny.bundle.root) in said
    assert said.endswith(
        f"{len(tiny.bundle.template)} vertices at {tiny.bundle.manifest.fps:g} fps>"
    )


def test_a_frame_of_a_stream_in_one_line():
    codes, weights = np.zeros(8, np.int64), np.zeros(52, np.float32)
    frame = LiveFrame(3, 0.1, codes, weights, np.zeros((5886, 3), np.float32))
    assert repr(frame) == "<LiveFrame 3 at 0.100 s: 8 codes, 52 weights, 5,886 vertices>"
    bare = dataclasses.replace(frame, weights=None, offsets=None)
    assert repr(bare) == "<LiveFrame 3 at 0.100 s: 8 codes>"
