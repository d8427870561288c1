"""What other libraries say, fit for a line of ours."""

from __future__ import annotations

LONGEST = 300


def one_line(said: object, longest: int = LONGEST) -> str:
    """The text of an error on one printable line, cut where it is long; its class if empty."""
    text = " ".join(str(said).split()) or type(said).__name__
    text = "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)
    return text if len(text) <= longest else f"{text[:longest]}..."
