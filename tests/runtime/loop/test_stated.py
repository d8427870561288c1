"""Sizes read from what a manifest states."""

from pathlib import Path

import pytest

from facecode.errors import GraphError, ManifestError
from facecode.loop.stated import stated_graphs


def test_what_goes_wrong_is_the_manifests():
    with pytest.raises(ManifestError, match="not those of such parts"), stated_graphs(Path("b")):
        int("n_heads")
    with pytest.raises(GraphError, match="ours"), stated_graphs(Path("b")):
        raise GraphError("ours")
