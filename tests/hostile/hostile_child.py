"""One process that makes damaged inputs and tries them, under limits, until it is told to stop.

Started by hostile_run: it reads `kind seed number` a line and answers with a line of JSON.
"""

import gc
import io
import json
import os
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

import hostile_bundles
import hostile_files
import numpy as np

import facecode
from facecode.errors import FacecodeError

MEMORY = 3 << 30
"""Bytes of address space that a trial may take beyond what the process has when it begins."""
LONGEST_MESSAGE = 3000
DATA = Path(__file__).parents[1] / "data"
TINY_SYSTEM = "codetalker-tiny"


def try_bundle(folder):
    face = facecode.load(folder / "input", threads=1)
    face.bundle.neutral(None)
    for name in face.manifest.identities:
        face.bundle.neutral(name)
    for name in face.manifest.regions:
        face.bundle.region(name)
    from facecode.cli.info import summary

    summary(face.bundle)
    clip = face.animate(SPEECH, vertices=True)
    with np.errstate(all="ignore"):
        clip.vertices  # noqa: B018


def try_recording(folder):
    from facecode.audio import load_audio

    audio = load_audio(folder / "input", 16_000)
    assert np.isfinite(audio).all()


def try_clip(folder):
    from facecode.cli.hold_option import parse_hold
    from facecode.clip_file import read_clip

    try:
        parse_hold(f"face={folder / 'input.npz'}")
    finally:
        clip = read_clip(folder / "input.npz")
        clip.save(folder / "out.glb")
        clip.save(folder / "out.csv") if clip.rig is not None else None


def try_template(folder):
    from facecode.template import check_fit, load_template

    (file,) = folder.glob("input.*")
    template = load_template(file, hostile_files.N_VERTICES)
    check_fit(template, np.load(DATA / "tiny-bundle/template.npy"), "metres")


def try_avatar(folder):
    from avatars import Motion

    from facecode.writers.onto import onto

    (file,) = folder.glob("input.*")
    onto(Motion(), file, io.BytesIO())


def try_style(folder):
    from facecode.loop.request import style_weights
    from facecode.options import parse_style

    text = (folder / "input").read_bytes().decode("utf-8", "surrogatepass")
    style_weights(parse_style(text), ("a", "b", "c"))


def try_config(folder):
    from facecode_exporter.config import system_from_config, with_encoder_config
    from facecode_spec.systems import SYSTEMS

    (file,) = folder.glob("input.*")
    if file.suffix == ".json":
        with_encoder_config(SYSTEMS["codetalker-vocaset"], file)
    else:
        system_from_config(file)


def try_checkpoint(folder):
    from facecode_exporter.checkpoints import load_system
    from facecode_spec.systems import SYSTEMS

    load_system(SYSTEMS[TINY_SYSTEM], [folder / "stage1.pth"], [folder / "stage2.pth"])


def make_trap(rng, folder):
    (folder / "input").write_text(str(int(rng.integers(100))))
    return "trap"


def try_trap(folder):
    """What must not happen, so that the run can be seen to notice it."""
    name = os.environ["HOSTILE_TRAP"]
    if name == "crash":
        os.abort()
    elif name == "hang":
        time.sleep(600)
    elif name == "defect":
        raise KeyError("features")
    elif name == "unclear":
        raise FacecodeError("two\nlines")
    elif name == "noise":
        os.write(2, b"a library speaks")
    elif name == "outside":
        (folder.parent / "secret/secret.npy").read_bytes()
    elif name == "outside, unseen by Python":
        os.system(f"cat {folder.parent}/secret/secret.npy > /dev/null")
    elif name == "memory":
        bytearray(MEMORY)


def make_bundle(rng, folder):
    return hostile_bundles.make(rng, folder / "input")


KINDS = {
    "trap": (make_trap, try_trap),
    "bundle": (make_bundle, try_bundle),
    "recording": (hostile_files.make_recording, try_recording),
    "clip": (hostile_files.make_clip, try_clip),
    "template": (hostile_files.make_template, try_template),
    "avatar": (hostile_files.make_avatar, try_avatar),
    "style": (hostile_files.make_style, try_style),
    "config": (hostile_files.make_config, try_config),
    "checkpoint": (hostile_files.make_checkpoint, try_checkpoint),
}
SPEECH = np.sin(np.arange(4000, dtype=np.float32) / 20) / 4


class Watch:
    """Files that Python opens while a trial runs."""

    def __init__(self):
        self.folder = None
        self.outside = []
        own = [Path(p).resolve() for p in (sys.prefix, sys.base_prefix, *sys.path) if p]
        self.allowed = tuple({str(p) for p in own} | {"/proc", "/sys", "/usr/lib", "/usr/share"})
        sys.addaudithook(self.hook)

    def hook(self, event, args):
        if (
            self.folder is None
            or event != "open"
            or not isinstance(args[0], (str, bytes, os.PathLike))
        ):
            return
        name = os.fsdecode(args[0])
        if "\0" in name:
            return
        path = os.path.realpath(name)
        if not path.startswith((str(self.folder), *self.allowed)):
            self.outside.append(path)


def trial(watch, kind, seed, number, base):
    """What happened, as a dictionary."""
    make, attempt = KINDS[kind]
    rng = np.random.default_rng((seed, sorted(KINDS).index(kind), number))
    folder = Path(tempfile.mkdtemp(dir=base))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        done = {"what": str(make(rng, folder))}
    os.ftruncate(2, 0)
    begin, watch.outside = time.process_time(), []
    watch.folder = folder.resolve()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            attempt(folder)
        done["outcome"] = "taken"
    except FacecodeError as error:
        text = str(error)
        done |= {"outcome": "refused", "class": type(error).__name__, "message": text[:400]}
        lines = text.splitlines()
        clear = text.isprintable() or (kind == "checkpoint" and "problems" in lines[0])
        if not clear or len(text) > LONGEST_MESSAGE or not text.strip():
            done["outcome"] = "unclear"
    except BaseException as error:
        done |= {"outcome": "defect", "class": type(error).__name__}
        done["message"] = "".join(traceback.format_exception(error))[-1500:]
    finally:
        watch.folder = None
    done |= {"cpu_s": round(time.process_time() - begin, 3), "outside": watch.outside[:5]}
    done["noise"] = os.pread(2, 300, 0).decode("utf-8", "replace")
    shutil.rmtree(folder, ignore_errors=True)
    return done


def main():
    base = Path(sys.argv[1])
    answers = os.fdopen(os.dup(1), "w")
    noise = os.open(base / "noise", os.O_RDWR | os.O_CREAT | os.O_APPEND)
    os.dup2(noise, 2)
    os.dup2(noise, 1)
    hostile_bundles.seeds()
    watch = Watch()
    limited = False
    for line in sys.stdin:
        kind, seed, number = line.split()
        if not limited:  # after what the first trial imports
            trial(watch, kind, int(seed), int(number), base)
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY,) * 2)
            limited = True
        answer = trial(watch, kind, int(seed), int(number), base)
        answer["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
        answers.write(json.dumps(answer) + "\n")
        answers.flush()
        gc.collect()


if __name__ == "__main__":
    main()
