"""Errors and size limit of model files.

This module imports no other module of MissionTree, so that every command can use it at little cost.
"""

from pathlib import Path


class ModelFileError(ValueError):
    """A model file that does not contain the expected network; the message names the file and the next command."""


MAX_MODEL_BYTES = 200_000_000
"""Largest size in bytes of a model file, which is read as a whole: five times the largest one for faces."""


def check_model_size(model: Path, hint: str) -> None:
    """Raise ModelFileError if a model file is too large, OSError if it cannot be read.

    ``hint`` is the command to try next, for the message.
    """
    if (size := model.stat().st_size) > MAX_MODEL_BYTES:
        raise ModelFileError(
            f"faces: {model} is not a network: {size:,} bytes, above the limit of {MAX_MODEL_BYTES:,}\n  try: {hint}"
        )
