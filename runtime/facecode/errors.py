"""Everything that facecode raises on purpose. Messages say: got, expected, what to do next.

Every failure has a class of its own under `FacecodeError`, which is a builtin exception too:
ValueError for a value, FileNotFoundError for a missing file, OSError and RuntimeError for what the
machine or a graph refuses, ImportError for a missing package.
"""

from __future__ import annotations


class FacecodeError(Exception):
    """Base of all errors that facecode raises on purpose."""

    exit_code = 2
    """At the command line: the caller's mistake, unless a subclass says otherwise."""


class AudioError(FacecodeError, ValueError):
    """The audio cannot be animated."""


class UnreadableAudioError(AudioError):
    """The file is not audio that libsndfile reads."""


class EmptyAudioError(AudioError):
    """The audio has no samples."""


class AudioTooShortError(AudioError):
    """The audio is shorter than one frame."""


class NonFiniteAudioError(AudioError):
    """The audio holds NaN or infinite samples."""


class AudioWarning(UserWarning):
    """The audio can be animated, and is hardly what was meant."""


class AudioNotFoundError(FacecodeError, FileNotFoundError):
    """No audio file at the given path."""


class StyleError(FacecodeError, ValueError):
    """The bundle has no such style, or the style weights are invalid."""


class StyleWarning(UserWarning):
    """The weights of a style mix do not sum to one."""


class TemplateError(FacecodeError, ValueError):
    """The template cannot be read or has another topology."""


class BundleError(FacecodeError):
    """The bundle cannot be used."""


class BundleNotFoundError(BundleError, FileNotFoundError):
    """No bundle at the given path."""


class ManifestError(BundleError, ValueError):
    """The manifest does not have the form that this release reads."""


class NewerBundleError(ManifestError):
    """The bundle was written by a later release."""


class UnsafePathError(BundleError, ValueError):
    """The manifest names a path that leaves the bundle."""


class MissingFileError(BundleError, FileNotFoundError):
    """A file that the manifest lists is not there."""


class AlteredFileError(BundleError, ValueError):
    """A file differs from what the manifest says."""


class ExternalDataError(BundleError, ValueError):
    """A graph reads a file that the manifest does not list."""


class GraphError(BundleError, RuntimeError):
    """onnxruntime cannot load or run a graph."""


class ThreadsError(FacecodeError, ValueError):
    """No thread, or more than a graph can use."""


class ProviderError(FacecodeError, RuntimeError):
    """onnxruntime lacks an execution provider, or the provider does not start."""


class ModeError(FacecodeError, ValueError):
    """Unknown mode, or a window that does not fit it."""


class StreamError(FacecodeError):
    """The stream cannot take this."""


class LookAheadError(StreamError, ValueError):
    """A look-ahead that no stream has."""


class StreamEndedError(StreamError, RuntimeError):
    """Speech after the end of a stream."""


class StreamRateError(StreamError, ValueError):
    """Another sample rate in mid-stream."""


class MicrophoneError(StreamError, OSError):
    """The microphone cannot be opened, or has stopped."""


class AddressError(StreamError, ValueError):
    """Frames cannot be sent there."""


class SampleError(FacecodeError, ValueError):
    """The bundle does not give these samples."""


class CodesError(FacecodeError, ValueError):
    """Codes of another shape, or outside the codebook."""


class NoCodesError(CodesError):
    """The system gives motion itself and has no codes."""


class ClipFileError(FacecodeError, ValueError):
    """The file holds no clip that facecode wrote."""


class ClipNotFoundError(FacecodeError, FileNotFoundError):
    """No clip at the given path."""


class OutputError(FacecodeError):
    """The result cannot be written."""


class OutputSuffixError(OutputError, ValueError):
    """No writer for this file name."""


class OutputFolderError(OutputError, FileNotFoundError):
    """The folder of the output does not exist."""


class OutputWriteError(OutputError, OSError):
    """Writing failed; nothing was left behind."""


class NoFacesError(OutputError, ValueError):
    """The format shows a surface, and the bundle knows no triangles."""

    @classmethod
    def to_write(cls, suffix: str) -> NoFacesError:
        """The error for a format that needs faces."""
        return cls(
            f"{suffix} needs faces, and this bundle has none: export it again with "
            "--template MESH, a .ply or .obj with triangles"
        )


class NoRigError(OutputError, ValueError):
    """The format holds weights of face units, and the bundle has none."""

    @classmethod
    def to_write(cls, suffix: str) -> NoRigError:
        """The error for a format, or for weights, that need a rig."""
        return cls(
            f"{suffix} need face units (names and deltas (K, V, 3)), and this face has none: "
            "export the bundle with --units FILE.npz, or give them as `rig`, "
            "dataclasses.replace(clip, rig=facecode.Rig(names, deltas))"
        )


class NoVerticesError(OutputError, ValueError):
    """The clip has weights alone."""

    @classmethod
    def to_give(cls, what: str) -> NoVerticesError:
        """The error for a format, or for `vertices`."""
        return cls(
            f"{what} need vertices, and this clip was animated with vertices=False: leave that out"
        )


class TakenBlocksError(OutputError, ValueError):
    """Blocks can be taken once, and some were taken before they were written."""


class EmptyClipError(OutputError, ValueError):
    """The format shows motion, and the clip has no frame."""


class UnitNamesError(OutputError, ValueError):
    """The format holds units of certain names, and the rig has none of them."""


class OntoError(FacecodeError, ValueError):
    """The avatar cannot be read, or none of its shapes bears the name of a face unit."""


class AvatarNotFoundError(FacecodeError, FileNotFoundError):
    """No avatar at the given path."""


class CorpusError(FacecodeError, ValueError):
    """The recordings of a corpus cannot be listed, or two have one name."""


class CorpusNotFoundError(FacecodeError, FileNotFoundError):
    """No corpus at the given path."""


class OtherBatchError(FacecodeError, ValueError):
    """The folder holds the results of another batch."""


class WorkerError(FacecodeError, RuntimeError):
    """A worker died, and so did those that took up its portion."""

    exit_code = 1


class MissingExtraError(FacecodeError, ImportError):
    """An optional dependency is not installed."""

    @classmethod
    def of(cls, what: str, package: str, extra: str) -> MissingExtraError:
        """The error for `what`, which needs `package` out of the extra `extra`."""
        return cls(f"{what} needs {package}; in a clone of facecode: pip install '.[{extra}]'")
