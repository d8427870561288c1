"""Recordings, clips, meshes, avatars, styles, configurations and checkpoints that are damaged."""

import functools
import io
import json
import tempfile
from pathlib import Path

import numpy as np
import yaml
from hostile_bytes import (
    TEXTS,
    change_array,
    change_tree,
    change_zip,
    damaged,
    damaged_text,
    odd_value,
    pick,
)

DATA = Path(__file__).parents[1] / "data"
SKIPPED = {"RAW", "SD2"}
"""RAW has no header, SD2 keeps it in another file."""
N_VERTICES = 42


@functools.cache
def recordings():
    """A short recording in each container and coding of libsndfile, as (suffix, bytes)."""
    import soundfile

    import facecode

    samples, rate = soundfile.read(Path(facecode.__file__).parent / "assets/speech.flac")
    short, made = samples[: rate // 4], []
    for container in sorted(set(soundfile.available_formats()) - SKIPPED):
        for coding in sorted(soundfile.available_subtypes(container)):
            for channels in (1, 2):
                buffer = io.BytesIO()
                block = np.repeat(short[:, None], channels, 1)
                try:
                    soundfile.write(buffer, block, rate, coding, format=container)
                except (RuntimeError, ValueError, TypeError):
                    continue
                made.append((container.lower(), buffer.getvalue()))
    return made


def make_recording(rng, folder):
    suffix, data = pick(rng, recordings())
    (folder / "input").write_bytes(damaged(rng, data))
    return suffix


@functools.cache
def clip_arrays():
    import facecode

    clip = facecode.load(DATA / "tiny-bundle", threads=1).animate(np.zeros(8000, np.float32))
    with tempfile.TemporaryDirectory() as folder:
        clip.save(Path(folder) / "clip.npz")
        with np.load(Path(folder) / "clip.npz") as arrays:
            return dict(arrays)


def make_clip(rng, folder):
    (folder / "input.npz").write_bytes(change_zip(rng, clip_arrays()))
    return "npz"


@functools.cache
def meshes():
    import trimesh

    template = np.load(DATA / "tiny-bundle/template.npy")
    faces = np.load(DATA / "tiny-bundle/faces.npy")
    mesh = trimesh.Trimesh(template, faces, process=False)
    made = [("ply", mesh.export(file_type="ply", encoding=e)) for e in ("ascii", "binary")]
    textured = made[0][1].replace(
        b"comment", b"comment TextureFile ../secret/secret.npy\ncomment", 1
    )
    obj = mesh.export(file_type="obj")
    obj = f"mtllib ../secret/secret.npy\n{obj}"
    return [*made, ("ply", textured), ("obj", obj.encode())]


WORDS = (
    b"nan",
    b"inf",
    b"-1",
    b"99999999999999999999",
    b"1e999",
    b"f 1 2",
    b"f 0 0 0",
    b"v",
    b"v a b c",
    b"f 1/2/3/4 2//3 -9",
    b"element vertex 4000000000",
    b"element face -1",
    b"property list x y z",
    b"property list uint64 float vertex_indices",
    b"format binary_big_endian 1.0",
    b"end_header",
    b"comment TextureFile /etc/passwd",
    b"mtllib /etc/passwd",
)


def make_template(rng, folder):
    if rng.random() < 0.3:
        template = np.load(DATA / "tiny-bundle/template.npy")
        (folder / "input.npy").write_bytes(change_array(rng, template))
        return "npy"
    suffix, data = pick(rng, meshes())
    if rng.random() < 0.5:
        lines = data.split(b"\n")
        for _ in range(int(pick(rng, (1, 1, 2, 4)))):
            at = int(rng.integers(min(len(lines), 16 if rng.random() < 0.5 else len(lines))))
            if rng.random() < 0.5:
                lines[at] = pick(rng, WORDS)
            else:
                words = lines[at].split() or [b""]
                words[int(rng.integers(len(words)))] = pick(rng, WORDS)
                lines[at] = b" ".join(words)
        data = b"\n".join(lines)
    else:
        data = damaged(rng, data)
    (folder / f"input.{suffix}").write_bytes(data)
    return suffix


@functools.cache
def avatars():
    from avatars import ARKIT, avatar

    return avatar([("Face", ARKIT), ("Teeth", ARKIT[:9])], "mesh")


def make_avatar(rng, folder):
    """A .glb or a .gltf: its JSON or its bytes changed."""
    from avatars import container

    tree, binary = avatars()
    tree = json.loads(json.dumps(tree))
    suffix = pick(rng, ("glb", "glb", "gltf", "vrm"))
    if rng.random() < 0.7:
        for _ in range(int(pick(rng, (1, 1, 2, 5)))):
            change_tree(rng, tree)
    if suffix == "gltf":
        (folder / "buffer.bin").write_bytes(binary)
        if (
            isinstance(tree.get("buffers"), list)
            and tree["buffers"]
            and isinstance(tree["buffers"][0], dict)
        ):
            place = pick(
                rng, ("buffer.bin", "../secret/secret.npy", "/etc/passwd", "none", "data:,", ".")
            )
            tree["buffers"][0]["uri"] = place
        text = json.dumps(tree).encode("utf-8", "surrogatepass")
        (folder / "input.gltf").write_bytes(damaged(rng, text) if rng.random() < 0.2 else text)
        return suffix
    try:
        data = container(tree, binary)
    except (UnicodeEncodeError, ValueError):
        data = container({}, binary)
    (folder / f"input.{suffix}").write_bytes(damaged(rng, data) if rng.random() < 0.4 else data)
    return suffix


def make_style(rng, folder):
    names = ["a", "b", "c", *TEXTS]
    text = ",".join(
        f"{pick(rng, names)}{pick(rng, (':', '', '::', '='))}{odd_value(rng)}"[:200]
        for _ in range(int(rng.integers(1, 4)))
    )
    (folder / "input").write_bytes(text.encode("utf-8", "surrogatepass"))
    return "style"


CONFIGS = (
    DATA / "codetalker-vocaset-tiny/config.yaml",
    DATA / "codetalker-biwi-tiny/config.yaml",
    DATA / "faceformer-vocaset-tiny/config.yaml",
)


def make_config(rng, folder):
    """A YAML of the public code, or a speech encoder's JSON."""
    if rng.random() < 0.3:
        text = (DATA / "codetalker-vocaset-tiny/wav2vec2.json").read_text()
        tree = json.loads(text)
        change_tree(rng, tree)
        data = (
            json.dumps(tree).encode("utf-8", "surrogatepass")
            if rng.random() < 0.7
            else damaged_text(rng, text)
        )
        (folder / "input.json").write_bytes(data)
        return "json"
    text = pick(rng, CONFIGS).read_text()
    tree = yaml.safe_load(text)
    for _ in range(int(pick(rng, (1, 1, 2)))):
        change_tree(rng, tree)
    try:
        data = yaml.safe_dump(tree).encode("utf-8", "surrogatepass")
    except yaml.YAMLError:
        data = text.encode()
    if rng.random() < 0.2:
        data = damaged_text(rng, text)
    elif rng.random() < 0.05:  # each line ten times the one before
        data = b"a0: &a0 [x]\n" + b"".join(
            b"a%d: &a%d [%s]\n" % (i, i, b",".join([b"*a%d" % (i - 1)] * 10)) for i in range(1, 12)
        )
    (folder / "input.yaml").write_bytes(data)
    return "yaml"


@functools.cache
def states():
    from facecode_exporter.checkpoints import save_system
    from facecode_exporter.random_weights import random_network
    from facecode_spec.systems import SYSTEMS

    with tempfile.TemporaryDirectory() as folder:
        files = Path(folder) / "stage1.pth", Path(folder) / "stage2.pth"
        save_system(random_network(SYSTEMS["codetalker-tiny"], 0), files[:1], files[1:])
        return [file.read_bytes() for file in files]


def make_checkpoint(rng, folder):
    """Both stages; one of them damaged in its bytes, or in what it holds."""
    files = list(states())
    which = int(rng.integers(2))
    files[which] = (
        damaged(rng, files[which]) if rng.random() < 0.4 else _other_state(rng, files[which])
    )
    for name, data in zip(("stage1.pth", "stage2.pth"), files, strict=True):
        (folder / name).write_bytes(data)
    return "checkpoint"


def _other_state(rng, data):
    import torch

    state = torch.load(io.BytesIO(data), weights_only=True)["state_dict"]
    name = pick(rng, sorted(state))
    value = state[name]
    state[name] = pick(
        rng,
        (
            lambda: value[..., :1],
            lambda: value * float("nan"),
            lambda: value.double(),
            lambda: value.bool(),
            lambda: value[None],
            lambda: torch.tensor(1.0),
            lambda: value.to_sparse(),
            lambda: value.to("meta"),
            lambda: torch.zeros(1).expand(10**6, 10**6),
            lambda: torch.zeros(0),
            lambda: odd_value(rng),
            lambda: {"a": value},
            lambda: value.to(torch.complex64),
            lambda: np.float64(1.0),
            lambda: range(3),
            lambda: torch.quantize_per_tensor(value.reshape(-1), 0.1, 0, torch.qint8),
        ),
    )()
    if rng.random() < 0.3:
        state = {pick(rng, ("module.", "_orig_mod.", "x.", "")) + k: v for k, v in state.items()}
    whole = pick(
        rng,
        (
            {"state_dict": state},
            state,
            {"model": state},
            {"ema": state, "model": state},
            [state],
            {"epoch": 1},
            {"state_dict": {"state_dict": state}},
            {"state_dict": state, "args": Path("x")},
            {1: value},
            None,
        ),
    )
    buffer = io.BytesIO()
    torch.save(whole, buffer, _use_new_zipfile_serialization=bool(rng.random() < 0.8))
    return damaged(rng, buffer.getvalue()) if rng.random() < 0.2 else buffer.getvalue()
