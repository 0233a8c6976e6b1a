"""What can be wrong with the files that perception reads. Imports nothing of ours: every command can know it."""

from pathlib import Path


class ModelFileError(ValueError):
    """A file that does not hold the network that it should: the message says which, and what to type next."""


MAX_MODEL_BYTES = 200_000_000
"""Bytes of a model's file: five times what the largest of those for faces has, which are read into memory whole."""


def check_model_size(model: Path, hint: str) -> None:
    """Raise BadModel for a file that is larger than any model; ``cure`` says what to type. Raises OSError."""
    if (size := model.stat().st_size) > MAX_MODEL_BYTES:
        raise ModelFileError(
            f"faces: {model} is no network: it has {size:,} bytes, at most {MAX_MODEL_BYTES:,} are read\n  try: {hint}"
        )
