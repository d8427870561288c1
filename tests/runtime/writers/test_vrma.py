"""VRM animations: expressions and the nodes that carry their weights."""

import io

import numpy as np
import pytest
from conftest import SPEECH
from gltf_reading import Glb
from small_faces import NAMES, cut, rigged, still

import facecode
from facecode.writers.arkit import NAMES as ARKIT
from facecode.writers.arkit import pascal
from facecode.writers.vrma import EXTENSION, KINDS, PRESETS, VRMA, presets, write_blocks_vrma


def written(write, *args):
    file = io.BytesIO()
    write(*args, file)
    return Glb(file.getvalue())


def expression(glb, kind, name):
    """The weights of an expression, and their times."""
    node = glb.tree["extensions"][EXTENSION]["expressions"][kind][name]["node"]
    animation = glb.tree["animations"][0]
    (channel,) = [c for c in animation["channels"] if c["target"]["node"] == node]
    assert channel["target"]["path"] == "translation"
    sampler = animation["samplers"][channel["sampler"]]
    times, values = glb.accessor(sampler["input"]), glb.accessor(sampler["output"])
    assert not values[:, 1:].any()
    return times[:, 0], values[:, 0]


def test_every_unit_is_a_custom_expression():
    clip = rigged(7, fps=25.0)
    glb = written(lambda file: VRMA.write(clip, file, False))
    assert glb.tree["extensionsUsed"] == [EXTENSION]
    assert set(glb.tree["extensions"][EXTENSION]["expressions"]) == {"custom"}
    for index, name in enumerate(NAMES):
        times, weights = expression(glb, "custom", pascal(name))
        assert np.array_equal(times, np.float32(np.arange(7) / 25))
        assert np.array_equal(weights, clip.weights[:, index])


def test_presets_share_out_the_mouth():
    clip = facecode.load("demo", threads=1).animate(SPEECH, mode="window")
    glb = written(lambda file: PRESETS.write(clip, file, False))
    found = {
        name: expression(glb, "preset", name)[1]
        for name in ("aa", "ih", "ou", "ee", "oh", "blinkLeft", "blinkRight")
    }
    jaw = clip.weights[:, clip.weight_names.index("jawOpen")]
    assert np.abs(found["aa"] + found["oh"] + found["ee"] - jaw).max() < 1e-6
    for weights in found.values():
        assert weights.min() >= 0
        assert weights.max() <= 1
    blink = clip.weights[:, clip.weight_names.index("eyeBlinkLeft")]
    assert np.array_equal(found["blinkLeft"], blink)


def test_presets_stay_in_their_range():
    extremes = np.random.default_rng(0).integers(0, 2, (500, len(ARKIT))).astype(np.float32)
    for weights in presets(extremes).values():
        assert weights.min() >= 0
        assert weights.max() <= 1


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("cuts", [[1, 2, 3, 1], [0, 3, 0, 4]])
def test_bytes_do_not_depend_on_the_blocks(cuts, kind):
    clip, found = rigged(7), KINDS[kind]
    whole = written(lambda file: found.write(clip, file, False))
    blocks = written(lambda file: found.write_blocks(still(clip), 7, cut(clip, cuts), file))
    assert (blocks.text, blocks.binary) == (whole.text, whole.binary)


def test_no_frame_is_no_animation():
    glb = written(lambda file: VRMA.write(still(rigged(1)), file, False))
    assert "animations" not in glb.tree
    assert len(glb.tree["extensions"][EXTENSION]["expressions"]["custom"]) == len(NAMES)
    blocks = written(lambda file: write_blocks_vrma(still(rigged(1)), 0, [], file))
    assert blocks.text == glb.text
