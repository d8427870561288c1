"""The engine picks the loop of a part by its kind and by what is held."""

import numpy as np
import pytest
from conftest import SPEECH

from facecode.audio import load_audio
from facecode.errors import ModeError
from facecode.loop.held import HeldPart
from facecode.loop.offsets import OffsetsPart
from facecode.loop.step import GeneratedPart


def test_by_kind_and_by_what_is_held(tiny, tiny_faceformer):
    speech = load_audio(SPEECH, 16_000)[:8000]
    for face, kind in ((tiny, GeneratedPart), (tiny_faceformer, OffsetsPart)):
        (loop,) = face.engine.loops([face.engine.encode(speech)], face.engine.request())
        assert type(loop) is kind
    (part,), memory = tiny.engine.parts, tiny.engine.encode(speech)
    codes = np.zeros((memory.n_frames, part.codes_per_frame), np.int64)
    held = tiny.engine.request(hold={"face": codes})
    (loop,) = tiny.engine.loops([memory], held)
    assert type(loop) is HeldPart
    with pytest.raises(ModeError, match="2 recordings; expected one"):
        tiny.engine.loops([memory, memory], held)
