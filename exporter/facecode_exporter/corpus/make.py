"""Make the demo corpus: utterances in every style, written clip by clip.

Comes in: a folder, a length and a seed. Goes out: the layout of `corpus/files.py`. Interrupted, it
goes on where it stopped; made longer, it keeps what is there. A clip depends on the seed, its style
and its number only. Ten minutes take 20-25 s on one core and 13 MB, four fifths of it sound.
"""

from __future__ import annotations

import dataclasses
import gzip
import hashlib
import json
from collections.abc import Iterator
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

import facecode
from facecode.errors import MissingExtraError, OutputFolderError
from facecode_exporter.corpus.files import (
    ABOUT,
    FORMAT,
    HEAD,
    clip_path,
    load_about,
    load_corpus_head,
    load_phones,
    load_weights,
)
from facecode_exporter.corpus.phones import SAMPLE_RATE, Aligner
from facecode_exporter.corpus.rules import FPS, face_weights
from facecode_exporter.corpus.styles import STYLES, Style
from facecode_exporter.corpus.utterance import (
    Utterance,
    make_utterance,
    split_of,
    vocabulary_of,
)
from facecode_exporter.corpus.voices import SOURCES, Voice, available_voices
from facecode_exporter.corpus.writing import write_clip, write_generated, write_json, write_whole
from facecode_exporter.errors import CorpusError
from facecode_exporter.head.head import PACKAGED
from facecode_exporter.measures.lip_sync import LipSync, count_lip_sync

PACKAGES = ("hibari-tts", "pocketsphinx", "numpy", "scipy", "soxr", "onnxruntime")
LICENCES = {
    "head": "CC0 1.0, from the MakeHuman base mesh and the Face Units pack by Mika Suominen",
    "speech": "synthetic; each voice names its source and the licence of that source",
    "phones": "pocketsphinx and its US English model and cmudict, BSD",
    "text": "of this project, MIT; word lists from cmudict, BSD",
    "motion": "procedural, of this project, MIT",
}
BAR = "{desc}: {percentage:3.0f}%|{bar}| {n:.0f}/{total:.0f} s of speech [{elapsed}<{remaining}]"
WORD_LENGTHS = range(3, 10)


@dataclasses.dataclass(frozen=True)
class CorpusReport:
    """What a finished corpus holds."""

    n_clips: int
    seconds: float
    lip_sync: LipSync


def make_corpus(out: Path, minutes: float, seed: int = 0, progress: bool = True) -> CorpusReport:
    """Write or complete a corpus of at least `minutes` of speech in `out`.

    Raises:
        CorpusError: `out` holds something else, or a corpus of another seed or other voices.
        OutputFolderError: the folder around `out` does not exist.
        MissingExtraError: the packages of the extra `corpus` are not installed.
    """
    from tqdm import tqdm

    goal_s = 60 * minutes
    voices = available_voices()
    aligner, vocabulary = _tools()
    _begin(out, _about(seed, voices))
    report = CorpusReport(0, 0.0, LipSync())
    names: list[str] = []
    utterances = _Utterances(seed, aligner, voices, vocabulary)
    with tqdm(total=goal_s, unit="s", desc="corpus", disable=not progress, bar_format=BAR) as bar:
        try:
            for number, style in _clips():
                if report.seconds >= goal_s:
                    break
                name = clip_name(style, number)
                if not clip_path(out, "weights", name).is_file():
                    utterance = utterances.get(style, number)
                    chance = (seed, number, STYLES.index(style))
                    weights = face_weights(utterance.audio, utterance.phones, style, chance)
                    write_clip(out, name, utterance, weights)
                names.append(name)
                seconds, counted = _judged(out, name)
                report = CorpusReport(
                    len(names), report.seconds + seconds, report.lip_sync + counted
                )
                bar.update(min(seconds, goal_s - bar.n))
        finally:
            write_generated(out, names)
    return report


def clip_name(style: Style, number: int) -> str:
    """`<style>_<sentence>`, the name of a clip's files."""
    return f"{style.name}_{number:05d}"


def said_in_every_style(number: int) -> bool:
    """Whether all styles have the same sound: one in four in training, every other beside it.

    From these a model learns, and a test shows, what is the style and what is the speech.
    """
    return number % 4 == 0 if split_of(number) == "train" else number // 10 % 2 == 0


def _clips() -> Iterator[tuple[int, Style]]:
    number = 0
    while True:
        yield from ((number, style) for style in STYLES)
        number += 1


class _Utterances:
    """Utterances by style and number; the last one that all styles share is kept."""

    def __init__(
        self, seed: int, aligner: Aligner, voices: tuple[Voice, ...], vocabulary: list[str]
    ) -> None:
        self._seed, self._aligner = seed, aligner
        self._voices, self._vocabulary = voices, vocabulary
        self._shared = lru_cache(maxsize=1)(self._make)

    def get(self, style: Style, number: int) -> Utterance:
        if said_in_every_style(number):
            return self._shared(0, number)
        return self._make(1 + STYLES.index(style), number)

    def _make(self, stream: int, number: int) -> Utterance:
        key = (self._seed, stream, number)
        split = split_of(number)
        return make_utterance(key, split, self._aligner, self._voices, self._vocabulary)


def _tools() -> tuple[Aligner, list[str]]:
    """The aligner, and the words that both it and the neural voice know."""
    try:
        aligner = Aligner()
        lexicon = files("hibari") / "assets" / "lexicon_us_gold.json.gz"
        known = json.loads(gzip.decompress(lexicon.read_bytes()))
    except ModuleNotFoundError as error:
        raise MissingExtraError.of("the corpus", str(error.name), "corpus") from error
    return aligner, vocabulary_of(aligner, [word for word in known if len(word) in WORD_LENGTHS])


def _about(seed: int, voices: tuple[Voice, ...]) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "seed": seed,
        "fps": FPS,
        "sample_rate": SAMPLE_RATE,
        "unit": "m",
        "head_sha256": hashlib.sha256(PACKAGED.read_bytes()).hexdigest(),
        "styles": {style.name: dataclasses.asdict(style) for style in STYLES},
        "voices": {
            voice.name: {**dataclasses.asdict(voice), "made_with": SOURCES[voice.source]}
            for voice in voices
        },
        "packages": {"facecode": facecode.__version__} | {p: _version(p) for p in PACKAGES},
        "licences": LICENCES,
        "note": "procedural motion: it teaches timing, closures and styles, not captured realism",
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _begin(out: Path, about: dict[str, Any]) -> None:
    if not out.absolute().parent.is_dir():
        raise OutputFolderError(f"the folder {out.absolute().parent} does not exist; create it")
    if (out / ABOUT).is_file():
        there = load_about(out)
        differing = sorted(key for key in about if there.get(key) != about[key])
        if differing:
            raise CorpusError(
                f"{out} was made with other {', '.join(differing)}; "
                "name a new folder, or go on with the same seed, voices and versions"
            )
    elif out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise CorpusError(f"{out} exists and holds no {ABOUT}; name a new or empty folder")
    for kind in ("wav", "phones", "text", "weights"):
        (out / kind).mkdir(parents=True, exist_ok=True)
    write_whole(out / HEAD, PACKAGED.read_bytes())
    write_json(out / ABOUT, about)


def _judged(out: Path, name: str) -> tuple[float, LipSync]:
    head, weights = load_corpus_head(out), load_weights(out, name)
    rest = float(head.opening(np.zeros((1, weights.shape[1])))[0])
    counted = count_lip_sync(load_phones(out, name), head.opening(weights), rest, FPS)
    return len(weights) / FPS, counted
