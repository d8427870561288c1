"""CDFace, torch against the runtime: samples, conditions and held parts on random odd systems."""

import dataclasses

import numpy as np
import pytest
import torch

from facecode.animator import Animator
from facecode.bundle import Bundle
from facecode_exporter.bundles import parity
from facecode_exporter.bundles.neutral import read_neutral
from facecode_exporter.bundles.writer import write_bundle
from facecode_exporter.cli.main import main
from facecode_exporter.nets.speech import samples_for
from facecode_exporter.random_weights import random_network
from facecode_spec.systems import SYSTEMS

TINY = SYSTEMS["cdface-tiny"]


def reordered(system):
    """Upper face first, with the pairs grid and an input projection."""
    lips, upper = system.parts
    upper = dataclasses.replace(
        upper,
        conditions_on=(),
        n_samples=3,
        motion_decoder=dataclasses.replace(
            upper.motion_decoder, dim=20, input_projection=True, output_bias=False
        ),
    )
    lips = dataclasses.replace(lips, conditions_on=("upper_face",), n_samples=1)
    encoder = dataclasses.replace(system.speech_encoder, frame_grid="pairs")
    return dataclasses.replace(
        system, name="upper-first", fps=25, parts=(upper, lips), speech_encoder=encoder
    )


CASES = {"lips-first": TINY, "upper-first": reordered(TINY)}


@pytest.fixture(scope="module", params=CASES)
def exported(request, tmp_path_factory):
    net = random_network(CASES[request.param], seed=5)
    order = np.random.default_rng(0).permutation(net.system.n_vertices)
    sizes = np.cumsum([net.system.vertices_of(p) for p in net.system.parts])
    parts = dict(zip([p.name for p in net.system.parts], np.split(order, sizes[:-1]), strict=True))
    neutral = read_neutral(None, net.system.n_vertices)
    out = tmp_path_factory.mktemp("parts") / "bundle"
    manifest = write_bundle(net, out, dataclasses.replace(neutral, parts=parts), sources={})
    return net, Animator(Bundle.open(out)), manifest


def audio_of(speech, net, frames):
    n_samples = samples_for(net.system.speech_encoder, net.system.fps, frames)
    return np.resize(speech[0], n_samples + 11)


def test_the_manifest_names_the_parts(exported):
    net, _, manifest = exported
    assert [p.name for p in manifest.parts] == [p.name for p in net.system.parts]
    assert [p.n_samples for p in manifest.parts] == [p.n_samples for p in net.system.parts]
    assert manifest.parts[1].conditions_on == (manifest.parts[0].name,)
    assert all(c.n_codes == c.n_codes_equal for c in manifest.parity.cases)
    assert len(manifest.parity.cases) == 5


@pytest.mark.parametrize("frames", [1, 2, 9, 34])
@pytest.mark.parametrize("counts", [(1, 1), (3, 1), (2, 2), (3, 2)])
def test_samples_of_parts(exported, speech, frames, counts):
    net, animator, _ = exported
    asked = {p.name: min(n, p.n_samples) for p, n in zip(net.system.parts, counts, strict=True)}
    weights = np.array([0.5, 0.75, -0.25], np.float32)
    case = parity.Case(audio_of(speech, net, frames), weights, asked)
    result = parity.compare_clip(net, animator.engine, case)
    parity.require_parity([result])
    assert result.n_frames == frames


@pytest.mark.parametrize("held", [0, 1])
def test_a_held_part(exported, speech, held):
    net, animator, _ = exported
    part, other = net.system.parts[held], net.system.parts[1 - held]
    codes = np.random.default_rng(1).integers(
        0, part.codebook.n_codes, (12, part.codebook.codes_per_frame)
    )
    weights = np.eye(3, dtype=np.float32)[2]
    asked = {other.name: other.n_samples}
    case = parity.Case(audio_of(speech, net, 12), weights, asked, {part.name: codes})
    parity.require_parity([parity.compare_clip(net, animator.engine, case)])


def test_several_clips_with_samples_are_what_they_are_alone(exported, speech):
    net, animator, _ = exported
    asked = {p.name: p.n_samples for p in net.system.parts}
    engine = animator.engine
    memories = [engine.encode(audio_of(speech, net, n)) for n in (13, 7, 2)]
    weights = np.eye(3, dtype=np.float32)
    together = engine.move(memories, engine.request(weights, samples=asked))
    for (codes, offsets), memory, row in zip(together, memories, weights, strict=True):
        ((alone, moved),) = engine.move([memory], engine.request(row, samples=asked))
        np.testing.assert_array_equal(codes, alone)
        np.testing.assert_allclose(offsets, moved, atol=1e-5)


def test_samples_differ_and_heads_answer_for_their_rows(exported):
    """Head k of row k, from one pass over all heads."""
    net = exported[0].part_nets[0]
    generator = torch.Generator().manual_seed(0)
    tokens = torch.randn(3, 5, net.part.cross_modal_decoder.dim, generator=generator)
    rows = net.system.speech_encoder.memory_rows_per_frame
    memory = torch.randn(3, 5 * rows, net.part.cross_modal_decoder.dim, generator=generator)
    with torch.no_grad():
        every = net.every_head(tokens, memory)
        picked = net.features(tokens, memory, torch.tensor([2, 0, 1]))
    for row, head in enumerate((2, 0, 1)):
        assert torch.equal(picked[row], every[row, :, head])
    assert not torch.equal(every[:, :, 0], every[:, :, 1])


def test_the_second_part_sees_the_past_of_the_first(exported):
    """Another code in frame 1 changes the second part from frame 1 on and nothing before."""
    net = exported[0].part_nets[1]
    first = exported[0].part_nets[0].part
    generator = torch.Generator().manual_seed(0)
    book, decoder = first.codebook, net.part.cross_modal_decoder
    vectors = torch.randn(1, 4, book.codes_per_frame, book.dim, generator=generator)
    other = vectors.clone()
    other[:, 1] += 1
    rows = net.system.speech_encoder.memory_rows_per_frame
    memory = torch.randn(1, 4 * rows, decoder.dim, generator=generator)
    past = torch.randn(1, 3, 3 * net.n_vertices, generator=generator)
    with torch.no_grad():
        style = net.learnable_style_emb.weight[:1]
        one, two = (
            net.features(net.tokens(style, past, {first.name: v}), memory) for v in (vectors, other)
        )
    changed = (one != two).flatten(2).any(dim=-1)[0]
    assert changed.tolist() == [False, True, True, True]


@pytest.mark.parametrize("frames", [3, 20])
def test_window_of_the_whole_clip_is_exact(exported, speech, frames):
    """Samples, conditions and a held part, in `window` mode."""
    net, animator, _ = exported
    engine = animator.engine
    memory = engine.encode(audio_of(speech, net, frames))
    weights = np.array([0.5, 0.75, -0.25], np.float32)
    first = net.system.parts[0]
    counts = {p.name: min(2, p.n_samples) for p in net.system.parts}
    codes = np.zeros((memory.n_frames, first.codebook.codes_per_frame), np.int64)
    rest = {name: n for name, n in counts.items() if name != first.name}
    for samples, hold in ((counts, {}), (rest, {first.name: codes})):
        exact, window = (
            engine.move([memory], engine.request(weights, w, samples, hold))[0]
            for w in (None, animator.window("window", max(3, memory.n_frames)))
        )
        np.testing.assert_array_equal(window[0], exact[0])
        np.testing.assert_allclose(window[1], exact[1], atol=1e-5)


def test_init_export_verify(tmp_path, capsys):
    """From the command line: a pair of files a part, and the lips' vertices beside them."""
    files = tmp_path / "checkpoints"
    assert main(["init", "--system", "cdface-tiny", "--out", str(files)]) == 0
    pairs = [
        x
        for stage in ("stage1", "stage2")
        for x in (f"--{stage}", *(str(files / f"{stage}_{p.name}.pth.tar") for p in TINY.parts))
    ]
    out = str(tmp_path / "bundle")
    export = ["export", "--system", "cdface-tiny", *pairs, "--out", out, "--quiet"]
    assert main(export) == 2
    assert "give --lips FILE" in capsys.readouterr().err
    assert main([*export, "--lips", str(files / "lips.txt")]) == 0
    sources = Bundle.open(out).manifest.sources
    assert set(sources) == {"stage1_lips", "stage1_upper_face", "stage2_lips", "stage2_upper_face"}
    assert main(["verify", out, *pairs, "--quiet"]) == 0
    assert "84 of 84 codes equal" in capsys.readouterr().out
    assert main(["verify", out, *pairs[:2], *pairs[3:], "--quiet"]) == 2
    assert "one of each for: lips, upper_face" in capsys.readouterr().err
