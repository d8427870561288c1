"""What the server counts, and its text for Prometheus. Belongs to the event loop's thread."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

BUCKETS_S = (0.01, 0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0)
"""Upper bounds for the time of an answer."""


class Metrics:
    """Counts since the server began."""

    def __init__(self) -> None:
        """Begin at nothing."""
        self.sessions = 0
        """Now."""
        self.ended: Counter[str] = Counter()
        """Connections by how they ended; see docs/serve.md."""
        self.audio_s = 0.0
        self.frames = 0
        self.skipped_frames = 0
        self._answers: Counter[float] = Counter()
        self._answers_s = 0.0

    def answered(self, seconds: float) -> None:
        """Count an answer that came `seconds` after the speech that it waited for."""
        self._answers[next((b for b in BUCKETS_S if seconds <= b), float("inf"))] += 1
        self._answers_s += seconds

    def text(self) -> str:
        """All counts in Prometheus' text format, version 0.0.4."""
        return "".join(f"{line}\n" for line in self._lines())

    def _lines(self) -> Iterator[str]:
        yield from _metric("sessions", "gauge", "Sessions now.", self.sessions)
        yield from _head("connections_ended_total", "counter", "Connections by their end.")
        for reason, n in sorted(self.ended.items()):
            yield f'facecode_connections_ended_total{{reason="{reason}"}} {n}'
        heard = round(self.audio_s, 3)
        yield from _metric("audio_seconds_total", "counter", "Speech heard.", heard)
        yield from _metric("frames_total", "counter", "Frames sent.", self.frames)
        skipped = "Frames left out because speech waited too long."
        yield from _metric("frames_skipped_total", "counter", skipped, self.skipped_frames)
        what = "From the speech that a frame waited for to the frame, on the server."
        yield from _head("answer_seconds", "histogram", what)
        total = 0
        for bound in (*BUCKETS_S, float("inf")):
            total += self._answers[bound]
            le = "+Inf" if bound == float("inf") else f"{bound:g}"
            yield f'facecode_answer_seconds_bucket{{le="{le}"}} {total}'
        yield f"facecode_answer_seconds_sum {self._answers_s:.6f}"
        yield f"facecode_answer_seconds_count {total}"


def _head(name: str, kind: str, what: str) -> Iterator[str]:
    yield f"# HELP facecode_{name} {what}"
    yield f"# TYPE facecode_{name} {kind}"


def _metric(name: str, kind: str, what: str, value: float) -> Iterator[str]:
    yield from _head(name, kind, what)
    yield f"facecode_{name} {value}"
