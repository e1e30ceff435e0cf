"""What can go wrong, as types: one root, each child also the builtin a stranger would catch."""


class LidarAccumError(Exception):
    """Root of every error this package raises on purpose.

    The message is one sentence in the user's words; ``hint`` says what to do about it.
    """

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message} ({self.hint})" if self.hint else self.message


class InputError(LidarAccumError, ValueError):
    """An input file or folder is there but cannot be read as what it claims to be."""


class MissingInputError(InputError, FileNotFoundError):
    """An input file or folder does not exist, or holds no frame."""


class SettingsError(LidarAccumError, ValueError):
    """A setting has a value that makes no sense, alone or beside the others."""


class OutputExistsError(LidarAccumError, FileExistsError):
    """An output would overwrite what is already there."""


class OutputError(LidarAccumError, OSError):
    """An output cannot be written."""


class DoubtfulResultError(LidarAccumError, RuntimeError):
    """The result was produced but should not be trusted; raised under ``--strict``."""


class MissingDependencyError(LidarAccumError, ImportError):
    """An optional package that this call needs is not installed."""


class ProcessLostError(LidarAccumError, ChildProcessError):
    """A process that worked for this one ended before its work was done."""
