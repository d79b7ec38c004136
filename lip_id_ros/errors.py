"""
Errors that this package raises.

Every message is one sentence that says what was expected, what came and what to do about it, so
that the command line and the nodes can show it as it is. Errors of the file system pass through
as `OSError`.

"""


class LipIdError(Exception):
    """Base of every error that this package raises on purpose."""


class ConfigError(LipIdError):
    """A setting has an unknown name, a wrong type or a value out of its range."""


class SourceError(LipIdError):
    """A recording cannot be read, or holds no usable joint samples."""


class TransferError(SourceError):
    """A remote recording could not be copied; another attempt may succeed."""


class DataError(LipIdError):
    """A data set contradicts itself or does not suffice for what is asked of it."""


class ShapeError(DataError):
    """An array does not have the shape that was expected."""


class ModelError(LipIdError):
    """A model file is corrupt, foreign or does not fit the robot at hand."""


class FitError(LipIdError):
    """Fitting failed for numerical reasons."""
