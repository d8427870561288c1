"""Recordings with their words, and where each sound lies.

Comes in: a folder of .wav or .flac with .txt of the same name. Goes out: audio and phones. The
aligner is that of the corpus; anything with its `align` will do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from facecode.arrays import Audio
from facecode.audio import load_audio
from facecode.errors import FacecodeError, MissingExtraError
from facecode_exporter.errors import EvaluationError

if TYPE_CHECKING:
    from facecode_exporter.measures.phone import Phone

ALIGNED_RATE = 16000
SUFFIXES = (".wav", ".flac")


class PhoneAligner(Protocol):
    """`facecode_exporter.corpus.phones.Aligner`, or anything that places words like it."""

    def align(self, audio: Audio, text: str) -> list[Phone]:
        """Phones from 0 to the end of `audio` (16 kHz)."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Speech whose sounds are placed."""

    name: str
    path: Path
    audio: Audio
    """(n,) 16 kHz"""
    phones: Sequence[Phone]

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return len(self.audio) / ALIGNED_RATE


class Skipped(NamedTuple):
    """A file that could not be used, and why."""

    name: str
    reason: str


def load_aligner() -> PhoneAligner:
    """The forced aligner of the corpus.

    Raises:
        MissingExtraError: pocketsphinx is not installed.
    """
    from facecode_exporter.corpus.phones import Aligner

    try:
        return Aligner()
    except ModuleNotFoundError as error:
        raise MissingExtraError.of("evaluate speech", str(error.name), "corpus") from error


def read_recordings(
    folder: Path,
    aligner: PhoneAligner,
    progress: Callable[[Sequence[Path]], Iterable[Path]] = iter,
) -> tuple[list[Recording], list[Skipped]]:
    """Every recording that has its words beside it and can be aligned; and those that cannot.

    Raises:
        EvaluationError: no folder, or not one recording that can be used.
    """
    if not folder.is_dir():
        raise EvaluationError(f"{folder} is no folder; expected one of <name>.wav with <name>.txt")
    recordings: list[Recording] = []
    skipped: list[Skipped] = []
    files = (path for path in folder.glob("[!.]*") if path.suffix.lower() in SUFFIXES)
    for path in progress(sorted(files)):
        try:
            recordings.append(_aligned(path, aligner))
        except FacecodeError as error:
            skipped.append(Skipped(path.name, str(error)))
    if not recordings:
        why = f" ({skipped[0].name}: {skipped[0].reason})" if skipped else ""
        raise EvaluationError(
            f"{folder} holds no recording that can be used{why}; "
            "expected <name>.wav or .flac with its words in <name>.txt"
        )
    return recordings, skipped


def _aligned(path: Path, aligner: PhoneAligner) -> Recording:
    text = path.with_suffix(".txt")
    if not text.is_file():
        raise EvaluationError(f"there is no {text.name}; write down what is said")
    audio = load_audio(path, ALIGNED_RATE)
    words = text.read_text(encoding="utf-8", errors="replace")
    return Recording(path.stem, path, audio, aligner.align(audio, words))
