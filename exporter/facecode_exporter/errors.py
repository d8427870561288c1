"""What can go wrong on the torch side.

FacecodeError
  ConfigError (ValueError)               a YAML or JSON configuration that cannot be used
  CheckpointError (ValueError)           keys or shapes that do not fit the system
    SwappedCheckpointsError              stage 1 given as stage 2 and the reverse
  CheckpointNotFoundError (FileNotFoundError)
  EvaluationError (ValueError)           motion or recordings that cannot be scored
    DataSetError                         truth that is not in the layout of VOCASET or BIWI
    RegionError                          vertex indices that are missing or do not fit the mesh
  OutputExistsError (FileExistsError)    a folder that is not ours to replace
  ParityError (ArithmeticError)          the bundle does not compute what the network computes
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


class OutputExistsError(FacecodeError, FileExistsError):
    """The output folder holds something that is not a bundle or checkpoint of facecode."""


class ParityError(FacecodeError, ArithmeticError):
    """Runtime and torch disagree beyond the stated tolerance."""

    exit_code = 1
