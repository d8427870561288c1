"""A worker: one loaded bundle that animates portions of a corpus and writes what they give."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TypeAlias

import facecode.loading
from facecode import writers
from facecode.animation import Animation
from facecode.animator import LONGEST_EXACT_S
from facecode.audio import AudioSource
from facecode.blocks import Blocks
from facecode.corpus.job import FILES_A_PORTION, PARQUET, Failure, Job, Outcome, Portion
from facecode.corpus.ledger import note
from facecode.corpus.reader import Reader
from facecode.corpus.recording import Recording
from facecode.errors import FacecodeError
from facecode.many import animate_many
from facecode.options import BatchOptions, parse_style

Made: TypeAlias = "Animation | Blocks | FacecodeError"


class Worker:
    """Animates portions, one after the other."""

    def __init__(self, job: Job) -> None:
        """Load the bundle; errors as of `facecode.load`."""
        self._job = job
        self._face = facecode.loading.load(job.bundle, compute=job.compute)
        self._reader = Reader()

    def do(self, portion: Portion) -> Outcome:
        """Animate a portion, write its results, and note that they are there.

        Raises:
            OutputWriteError, MissingExtraError: what would meet every recording.
        """
        finish = self._to_shard if self._job.format == PARQUET else self._to_files
        seconds, failures = finish(portion)
        outcome = Outcome(portion.number, len(portion.recordings), seconds, tuple(failures))
        note(self._job, outcome)
        return outcome

    def _to_files(self, portion: Portion) -> tuple[float, list[Failure]]:
        seconds, failures = 0.0, []
        for recording, made in self._animated(portion.recordings):
            path = self._job.out / f"{recording.id}.{self._job.format}"
            try:
                if isinstance(made, FacecodeError):
                    raise made
                path.parent.mkdir(parents=True, exist_ok=True)
                made.save(path)
                seconds += made.duration_s
            except FacecodeError as error:
                failures.append(Failure(recording.id, str(error)))
        return seconds, failures

    def _to_shard(self, portion: Portion) -> tuple[float, list[Failure]]:
        from facecode.corpus.shards import write_shard

        made = {r.id: clip for r, clip in self._animated(portion.recordings)}
        rows = [
            (r.id, clip) for r in portion.recordings if not isinstance(clip := made[r.id], Blocks)
        ]
        rig = self._face.bundle.rig
        path = self._job.out / f"part-{portion.number:06d}.parquet"
        write_shard(path, rows, None if rig is None else rig.names, self._job.offsets)
        seconds = sum(clip.duration_s for _, clip in rows if not isinstance(clip, FacecodeError))
        failures = [Failure(name, str(e)) for name, e in rows if isinstance(e, FacecodeError)]
        return seconds, failures

    def _animated(self, recordings: Sequence[Recording]) -> Iterator[tuple[Recording, Made]]:
        """Each with what it gives: long ones alone and in blocks, the others in batches."""
        short: list[tuple[Recording, AudioSource]] = []
        for recording in sorted(recordings, key=lambda r: (_manner(r), r.size, r.id)):
            try:
                audio = self._reader.audio(recording)
                if _duration_s(audio) > LONGEST_EXACT_S:
                    yield recording, self._long(recording, audio)
                else:
                    short.append((recording, audio))
            except FacecodeError as error:
                yield recording, error
        for _, alike in itertools.groupby(short, key=lambda item: _manner(item[0])):
            pairs = list(alike)
            for start in range(0, len(pairs), FILES_A_PORTION):
                yield from self._batch(pairs[start : start + FILES_A_PORTION])

    def _batch(
        self, pairs: Sequence[tuple[Recording, AudioSource]]
    ) -> Iterator[tuple[Recording, Made]]:
        recordings, sources = [r for r, _ in pairs], [audio for _, audio in pairs]
        try:
            style, options = (
                parse_style(recordings[0].style) or self._job.style,
                self._options(recordings[0]),
            )
            clips = animate_many(sources, style, face=self._face, **options)
            yield from zip(recordings, clips, strict=True)
        except FacecodeError as error:  # a style or template that the bundle does not have
            yield from ((recording, error) for recording in recordings)

    def _long(self, recording: Recording, audio: AudioSource) -> Made:
        options = self._options(recording)
        style = parse_style(recording.style) or self._job.style
        if self._job.format == PARQUET:
            return self._face.animate(audio, style, **options)
        return self._face.blocks(audio, style, **options)

    def _options(self, recording: Recording) -> BatchOptions:
        options = self._job.options.copy()
        if recording.template is not None:
            options["template"] = recording.template
        options["vertices"] = self._needs_vertices
        return options

    @property
    def _needs_vertices(self) -> bool:
        """Whether results hold vertices, or have no weights to be had without."""
        if self._job.format == PARQUET:
            return self._job.offsets or not self._face.gives_weights
        found = writers.format_of(Path(f"x.{self._job.format}"))
        return found.needs_vertices or not found.needs_rig or not self._face.gives_weights


def _manner(recording: Recording) -> tuple[str, str]:
    return recording.style or "", recording.template or ""


def _duration_s(audio: AudioSource) -> float:
    """Of a file by its header; 0 if it cannot be told, for whoever reads it to say why."""
    import soundfile

    try:
        info = soundfile.info(audio)
        return float(info.frames / info.samplerate)
    except (soundfile.SoundFileError, OSError, ZeroDivisionError):
        return 0.0
    finally:
        if hasattr(audio, "seek"):
            audio.seek(0)
