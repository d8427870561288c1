"""Open a bundle and load its graphs."""

from __future__ import annotations

import os

from facecode.animator import Animator
from facecode.bundle import PACKAGED_BUNDLE, Bundle
from facecode.session import Compute


def load(
    path: str | os.PathLike[str] | None = None,
    *,
    threads: int | None = None,
    compute: Compute | None = None,
) -> Animator:
    """Open and verify a bundle and load its graphs.

    Args:
        path: a folder, or the name of a packaged bundle; the packaged one by default.
        threads: short for `compute=Compute(threads)`.
        compute: threads and execution provider; all usable cores and the CPU by default.

    Raises:
        BundleError: see `facecode.errors`.
        ProviderError: onnxruntime lacks the provider.
        ThreadsError: no thread, or more than 256.
        ValueError: `threads` beside `compute`.
    """
    if threads is not None and compute is not None:
        raise ValueError("got threads beside compute; give Compute(threads=...) alone")
    bundle = Bundle.open(PACKAGED_BUNDLE if path is None else path)
    return Animator(bundle, Compute(threads) if compute is None else compute)
