"""Write the files of a corpus, each whole or not at all.

Comes in: utterances and weights. Goes out: the layout of `corpus/files.py`.
"""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from facecode.arrays import AnyArray
from facecode_exporter.corpus.files import SPLIT_FILE, clip_names, clip_path, load_about
from facecode_exporter.corpus.phones import SAMPLE_RATE
from facecode_exporter.corpus.utterance import SPLITS, Utterance, split_of

FIRST_ADDED = 50_000
"""Number of the first clip that is not of generated speech."""


def write_clip(out: Path, name: str, utterance: Utterance, weights: AnyArray) -> None:
    """One clip; its weights (T, 52) come last: a clip that has them is whole."""
    import soundfile

    sound, labels = io.BytesIO(), io.BytesIO()
    soundfile.write(sound, utterance.audio, SAMPLE_RATE, format="FLAC", subtype="PCM_16")
    np.save(labels, weights.astype(np.float16))
    write_whole(clip_path(out, "wav", name), sound.getvalue())
    about = {"voice": utterance.voice, "phones": utterance.phones}
    write_json(clip_path(out, "phones", name), about, indent=None)
    write_whole(clip_path(out, "text", name), f"{utterance.text}\n".encode())
    write_whole(clip_path(out, "weights", name), labels.getvalue())


def write_generated(out: Path, names: Sequence[str]) -> None:
    """The splits with these clips of generated speech; clips that were added stay."""
    added = _added(out)
    splits = {
        split: [name for name in names if split_of(_number(name)) == split] + added[split]
        for split in SPLITS
    }
    write_json(out / SPLIT_FILE, splits)


def write_added(out: Path, added: Mapping[str, Sequence[str]]) -> None:
    """The splits with these clips beside those of generated speech.

    Raises:
        CorpusError: no corpus.
    """
    load_about(out)
    splits = {
        split: [
            *(name for name in clip_names(out, split) if _number(name) < FIRST_ADDED),
            *added.get(split, ()),
        ]
        for split in SPLITS
    }
    write_json(out / SPLIT_FILE, splits)


def write_json(path: Path, value: object, indent: int | None = 1) -> None:
    """Plain values, whole or not at all."""
    write_whole(path, (json.dumps(value, indent=indent, ensure_ascii=False) + "\n").encode())


def write_whole(path: Path, content: bytes) -> None:
    """Whole or not at all."""
    fresh = path.with_name(f".{path.name}.part")
    try:
        fresh.write_bytes(content)
        fresh.replace(path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            fresh.unlink()


def _added(out: Path) -> dict[str, list[str]]:
    if not (out / SPLIT_FILE).is_file():
        return {split: [] for split in SPLITS}
    return {s: [n for n in clip_names(out, s) if _number(n) >= FIRST_ADDED] for s in SPLITS}


def _number(name: str) -> int:
    return int(name.rsplit("_", 1)[1])
