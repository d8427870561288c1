"""The folder layout of a demo corpus, and reading it.

    head.npz  corpus.json  splits.json
    wav/<style>_<sentence>.flac       16 kHz mono, 16 bit
    weights/<style>_<sentence>.npy    (T, 52) float16 ARKit weights at 30 fps
    phones/<style>_<sentence>.json    {"voice": name, "phones": [[phone, start_s, end_s], ...]}
    text/<style>_<sentence>.txt       what is said

A style is a training identity. Motion is kept as weights and expanded when read: an hour and a half
is 17 MB of weights and 11 GB of vertices.
"""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from facecode.arrays import Audio, Offsets
from facecode.audio import load_audio
from facecode_exporter.corpus.phones import SAMPLE_RATE
from facecode_exporter.corpus.rules import Weights
from facecode_exporter.errors import CorpusError
from facecode_exporter.head.head import Head, load_head
from facecode_exporter.measures.phone import Phone

ABOUT, SPLIT_FILE, HEAD = "corpus.json", "splits.json", "head.npz"
FORMAT = 1
SUFFIXES = {"wav": ".flac", "phones": ".json", "text": ".txt", "weights": ".npy"}


def clip_path(corpus: Path, kind: str, name: str) -> Path:
    """Where one of SUFFIXES lies for the clip `name`."""
    return corpus / kind / f"{name}{SUFFIXES[kind]}"


def load_about(corpus: Path) -> dict[str, Any]:
    """`corpus.json`: seed, styles, voices, versions, licences.

    Raises:
        CorpusError: no corpus, or one of another format.
    """
    about = _read_json(corpus / ABOUT)
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise CorpusError(f"{corpus / ABOUT}: not a demo corpus of format {FORMAT}; make it anew")
    return about


def clip_names(corpus: Path, split: str) -> list[str]:
    """Names of the clips in `train`, `val` or `test`.

    Raises:
        CorpusError: no corpus, or no such split.
    """
    splits = _read_json(corpus / SPLIT_FILE)
    if split not in splits:
        raise CorpusError(f"{corpus}: no split {split!r}; there are {', '.join(splits)}")
    return list(splits[split])


def load_clip_audio(corpus: Path, name: str) -> Audio:
    """(n,) float32 at 16 kHz."""
    return load_audio(clip_path(corpus, "wav", name), SAMPLE_RATE)


def load_phones(corpus: Path, name: str) -> list[Phone]:
    """The sounds of a clip and their times, from 0 to its end.

    Raises:
        CorpusError: no such clip.
    """
    return [Phone(*row) for row in _read_json(clip_path(corpus, "phones", name))["phones"]]


def load_voice(corpus: Path, name: str) -> str:
    """Who speaks in a clip: a name among the voices of `corpus.json`.

    Raises:
        CorpusError: no such clip.
    """
    return str(_read_json(clip_path(corpus, "phones", name))["voice"])


def load_weights(corpus: Path, name: str) -> Weights:
    """(T, 52) float16.

    Raises:
        CorpusError: no such clip, or a damaged file.
    """
    path = clip_path(corpus, "weights", name)
    try:
        weights: Weights = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise CorpusError(f"{path}: cannot be read ({error}); run `corpus` again") from error
    return weights


def load_offsets(corpus: Path, name: str) -> Offsets:
    """(T, V, 3) float32 metres from the template of the corpus's head.

    Raises:
        CorpusError: no such clip, or no head.
    """
    return load_corpus_head(corpus).offsets(load_weights(corpus, name))


@lru_cache(maxsize=2)
def load_corpus_head(corpus: Path) -> Head:
    """The head that the corpus animates."""
    return load_head(corpus / HEAD)


def _read_json(path: Path) -> Any:  # noqa: ANN401
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CorpusError(
            f"{path}: cannot be read ({error}); make it with: facecode-export corpus --out DIR"
        ) from error
