"""The option that the plug-in `diary` adds to `mission run`."""

from dataclasses import dataclass
from pathlib import Path

from missions.options import option
from missions.request import RunOptions, RunRequest


@dataclass(frozen=True, kw_only=True)
class DiaryOptions(RunOptions):
    """Whether a run keeps a diary."""

    diary: Path | None = option("Write a line for each behaviour that ends.", "path", metavar="FILE.diary")

    def check(self, request: RunRequest) -> None:
        """Raise ValueError for a name that `mission check` would not know."""
        if self.diary is not None and self.diary.suffix != ".diary":
            raise ValueError(f"--diary {self.diary}: the name must end in .diary")
