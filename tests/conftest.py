"""Shared cases: the goldens' checkpoints, their bundles, and a tiny bundle that needs no torch."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import pickle
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

# One thread a worker, and freed memory kept: read when a process starts, so by the workers and by
# the programs that tests run. Workers of several threads each would fight for the cores.
for _name, _value in {
    "OMP_NUM_THREADS": "1",
    "MALLOC_MMAP_THRESHOLD_": "4000000000",
    "MALLOC_TRIM_THRESHOLD_": "4000000000",
}.items():
    os.environ.setdefault(_name, _value)

import numpy as np  # noqa: E402
import pytest  # noqa: E402
import soundfile  # noqa: E402

import facecode  # noqa: E402

DATA = Path(__file__).parent / "data"
TINY = DATA / "tiny-bundle"
TINY_FACEFORMER = DATA / "tiny-faceformer"
SPEECH = Path(facecode.__file__).parent / "assets" / "speech.flac"
GOLDENS = ("codetalker-vocaset-tiny", "codetalker-biwi-tiny")
FACEFORMER_GOLDENS = ("faceformer-vocaset-tiny", "faceformer-biwi-tiny")


FORMS = {"vocaset": (2, "sentence{:02d}"), "biwi": (1, "e{:02d}")}


def make_folder(root, form, n_vertices):
    """A data set of a few short clips, at the rate and under the names of the real one."""
    rng = np.random.default_rng(0)
    from facecode_exporter.data.data_set import LAYOUTS

    layout, (keep_every, sentence) = LAYOUTS[form], FORMS[form]
    for folder in ("vertices_npy", "wav"):
        (root / folder).mkdir(parents=True)
    samples, rate = soundfile.read(SPEECH, dtype="float32")
    subjects = set(layout.seen[:2]) | set(layout.splits["validation"].subjects)
    templates = {s: rng.standard_normal((n_vertices, 3)) for s in subjects}
    (root / "templates.pkl").write_bytes(pickle.dumps(templates, protocol=2))
    fps = 30 if form == "vocaset" else 25
    for subject in sorted(subjects):
        for number in (1, 21, 33):
            n_frames = 20 + number % 3
            time = np.arange(n_frames * keep_every)[:, None] / fps / keep_every
            motion = np.sin(8 * time + np.arange(3 * n_vertices)) / 5
            name = f"{subject}_{sentence.format(number)}"
            np.save(root / "vertices_npy" / f"{name}.npy", motion + templates[subject].ravel())
            n_samples = int((n_frames + 2) * rate / fps)
            soundfile.write(root / "wav" / f"{name}.wav", samples[:n_samples], rate)
    return root


def pytest_report_header():
    """Versions and providers that a failure may depend on."""
    from importlib.metadata import version

    from facecode.session import available_providers, usable_cores

    names = ("numpy", "onnxruntime", "soundfile", "torch")
    versions = ", ".join(f"{name} {version(name)}" for name in names)
    return f"{versions}; {usable_cores()} cores; {', '.join(available_providers())}"


@pytest.fixture(scope="session", autouse=True)
def exported_once(request, tmp_path_factory):
    """Trace a view of the same weights once a session, whichever worker of xdist needs it first."""
    torch_tests = [Path(__file__).parent / name for name in ("exporter", "contract")]
    if not any(
        folder in item.path.parents for item in request.session.items for folder in torch_tests
    ):
        yield
        return
    from facecode_exporter.bundles import writer

    export_graph = writer.export_graph
    base = tmp_path_factory.getbasetemp()
    store = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "exported"
    store.mkdir(exist_ok=True)

    def export_or_copy(view, spec, path):
        weights = {name: tensor.numpy().tobytes() for name, tensor in view.state_dict().items()}
        plain = {k: v for k, v in vars(view).items() if isinstance(v, (int, float, str, tuple))}
        key = hashlib.sha256(repr((spec, view, sorted(plain.items()), weights)).encode())
        kept = store / f"{key.hexdigest()}.onnx"
        with kept.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not kept.exists():
                export_graph(view, spec, path)
                shutil.copy(path, kept.with_suffix(".part"))
                kept.with_suffix(".part").rename(kept)
        shutil.copy(kept, path)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(writer, "export_graph", export_or_copy)
        yield


@dataclass(frozen=True)
class Golden:
    """A case of the public code with its checkpoint files, by the option that takes each."""

    folder: Path
    files: dict[str, Path]

    @property
    def stage1(self):
        return self.files["stage1"]

    @property
    def stage2(self):
        return self.files["stage2"]

    @property
    def checkpoint(self):
        return self.files["checkpoint"]

    @property
    def config(self):
        return self.folder / "config.yaml"

    @property
    def wav2vec2(self):
        return self.folder / "wav2vec2.json"

    @property
    def speech(self):
        return self.folder / "speech.wav"

    @property
    def template(self):
        return self.folder / "template.npy"

    def export_args(self, out):
        files = [word for name, file in self.files.items() for word in (f"--{name}", str(file))]
        return [
            "export", *files,
            "--config", str(self.config), "--wav2vec2-config", str(self.wav2vec2),
            "--template", str(self.template), "--out", str(out), "--quiet",
        ]  # fmt: skip

    def styles(self):
        return json.loads((self.folder / "styles.json").read_text())

    def expected(self, i):
        with np.load(self.folder / f"expected_{i}.npz") as arrays:
            return arrays.get("codes"), arrays["vertices"]


def write_checkpoints(case: Path, out: Path) -> Golden:
    """The golden's float16 arrays as the two public checkpoint files, position tables included."""
    import torch
    import yaml

    from facecode_exporter.nets.sinusoid import sinusoid

    config = yaml.safe_load((case / "config.yaml").read_text())
    period = config["PREDICTOR"]["period"]
    paths = {}
    for stage in ("stage1", "stage2"):
        with np.load(case / f"{stage}.npz") as arrays:
            state = {n: torch.from_numpy(arrays[n]).float() for n in arrays.files}
        if stage == "stage1":
            for side in ("encoder", "decoder"):
                table = sinusoid(5000, config["NETWORK"]["hidden_size"])
                state[f"{side}.{side}_pos_embedding.pe"] = table[:, None]
        else:
            table = sinusoid(period, config["PREDICTOR"]["feature_dim"])
            state["PPE.pe"] = table.repeat(600 // period + 1, 1)[None]
        paths[stage] = out / f"{stage}.pth.tar"
        torch.save({"state_dict": state}, paths[stage])
    return Golden(case, paths)


def write_faceformer_checkpoint(case: Path, out: Path) -> Golden:
    """The golden's float16 arrays as the one public file: no wrapper, older weight-norm names."""
    import torch
    import yaml

    from facecode_exporter.nets.sinusoid import sinusoid

    config = yaml.safe_load((case / "config.yaml").read_text())
    table = sinusoid(config["period"], config["feature_dim"])
    state = {"PPE.pe": table.repeat(600 // config["period"] + 1, 1)[None]}
    spelling = {"parametrizations.weight.original0": "weight_g"}
    spelling["parametrizations.weight.original1"] = "weight_v"
    with np.load(case / "weights.npz") as arrays:
        for name in arrays.files:
            start, dot, end = name.partition("parametrizations.")
            public = f"{start}{spelling[dot + end]}" if dot else name
            state[public] = torch.from_numpy(arrays[name]).float()
    file = out / "faceformer.pth"
    torch.save(state, file)
    return Golden(case, {"checkpoint": file})


@pytest.fixture(scope="session", params=GOLDENS)
def golden(request, tmp_path_factory):
    return write_checkpoints(DATA / request.param, tmp_path_factory.mktemp(request.param))


@pytest.fixture(scope="session")
def golden_bundle(golden, tmp_path_factory):
    """The golden exported through the command line."""
    from facecode_exporter.cli.main import main

    out = tmp_path_factory.mktemp("bundles") / golden.folder.name
    assert main(golden.export_args(out)) == 0
    return out


@pytest.fixture(scope="session", params=FACEFORMER_GOLDENS)
def faceformer_golden(request, tmp_path_factory):
    out = tmp_path_factory.mktemp(request.param)
    return write_faceformer_checkpoint(DATA / request.param, out)


@pytest.fixture(scope="session")
def faceformer_bundle(faceformer_golden, tmp_path_factory):
    """The golden exported through the command line."""
    from facecode_exporter.cli.main import main

    out = tmp_path_factory.mktemp("bundles") / faceformer_golden.folder.name
    assert main(faceformer_golden.export_args(out)) == 0
    return out


@pytest.fixture(scope="session")
def vocaset_golden(tmp_path_factory):
    return write_checkpoints(DATA / GOLDENS[0], tmp_path_factory.mktemp("vocaset"))


@pytest.fixture(scope="session")
def tiny():
    """The committed bundle of random weights; see data/make_tiny_bundle.sh."""
    return facecode.load(TINY, threads=1)


@pytest.fixture(scope="session")
def tiny_faceformer():
    """The committed bundle without a codebook; see data/make_tiny_bundle.sh."""
    return facecode.load(TINY_FACEFORMER, threads=1)


@pytest.fixture
def tiny_copy(tmp_path):
    """A bundle to damage."""
    return shutil.copytree(TINY, tmp_path / "bundle")


@pytest.fixture(scope="session")
def speech():
    """The packaged recording: (samples, rate)."""
    return soundfile.read(SPEECH, dtype="float32")


@pytest.fixture
def run_cli(tmp_path):
    """Run `python -m facecode.cli` in another process, as a user would."""

    def run(*args, **kwargs):
        return subprocess.run(
            [sys.executable, "-m", "facecode.cli", *map(str, args)],
            capture_output=True,
            text=kwargs.pop("text", True),
            cwd=tmp_path,
            timeout=120,
            **kwargs,
        )

    return run


N_SMALL = 20
SMALL_SECONDS = (0.3, 0.7, 0.4, 1.1)


@pytest.fixture(scope="session")
def speeches(tmp_path_factory):
    """N_SMALL good recordings of four lengths in two folders, and one that is not audio."""
    folder = tmp_path_factory.mktemp("corpus")
    speech, rate = soundfile.read(SPEECH, dtype="float32")
    for i in range(N_SMALL):
        part = folder / f"{'ab'[i % 2]}"
        part.mkdir(exist_ok=True)
        start = int(rate * 0.2 * i)
        clip = np.resize(speech, 8 * rate)[start : start + int(SMALL_SECONDS[i % 4] * rate)]
        soundfile.write(part / f"{i:02d}.wav", clip, rate)
    (folder / "bad.wav").write_bytes(b"RIFF, but not for long")
    return folder


def contents(folder):
    """Every result of a batch, by its path."""
    files = (p for p in folder.rglob("*") if p.is_file() and ".batch" not in p.parts)
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}
