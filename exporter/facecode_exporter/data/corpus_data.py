"""A generated corpus as a data set, and the opening of any data set by its name."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from facecode.arrays import AnyArray, Template
from facecode_exporter.corpus.files import (
    clip_names,
    clip_path,
    load_corpus_head,
    load_offsets,
)
from facecode_exporter.data.data_set import ALL, CORPUS, LAYOUTS, DataSet
from facecode_exporter.errors import CorpusError, DataSetError


@dataclass(frozen=True)
class CorpusData(DataSet):
    """One split of a folder that `facecode-export corpus` wrote; a style is a subject."""

    @classmethod
    def read(cls, root: Path, split: str | None = None) -> CorpusData:
        """Find the clips of `split` (default: `test`).

        Raises:
            DataSetError: no such split, or no clips in it.
            CorpusError: not a corpus.
        """
        layout = LAYOUTS[CORPUS]
        split = layout.split_names[0] if split is None else split
        if split not in layout.split_names:
            raise DataSetError(
                f"got split {split!r}; expected one of {', '.join(layout.split_names)}"
            )
        splits = list(layout.splits) if split == ALL else [split]
        clips = tuple(name for part in splits for name in clip_names(root, part))
        if not clips:
            raise DataSetError(f"{root} has no clip of split {split!r}; make it longer")
        return cls(root, layout, clips, {})

    def template(self, clip: str) -> Template:  # noqa: ARG002
        """The head's neutral face (V, 3) float32, the same for all styles."""
        return load_corpus_head(self.root).template

    def truth(self, clip: str) -> AnyArray:
        """Vertices (T, V, 3) of the rules.

        Raises:
            CorpusError: a damaged file.
        """
        vertices: AnyArray = load_offsets(self.root, clip) + self.template(clip)
        return vertices

    def speech(self, clip: str) -> Path:
        """The recording of a clip.

        Raises:
            CorpusError: there is none.
        """
        path = clip_path(self.root, "wav", clip)
        if not path.is_file():
            raise CorpusError(f"{path} is missing; run `facecode-export corpus` again")
        return path


def open_data_set(root: Path, name: str, split: str | None = None) -> DataSet:
    """The data set in the layout `name`, one of LAYOUTS; `split` None is the layout's first.

    Raises:
        DataSetError, CorpusError.
    """
    return (
        CorpusData.read(root, split) if name == CORPUS else DataSet.open(root, LAYOUTS[name], split)
    )
