"""The pictures of a folder, or one picture, at a steady rate."""

from collections.abc import Callable, Iterator
from pathlib import Path

from drivers.api import Image
from drivers.camera.decode import UNWANTED, load
from drivers.camera.source import PICTURES
from drivers.errors import BadRequest, NotConnected


class FolderFeed:
    """The pictures of a folder in the order of their names, or one picture. Files that do not decode are skipped.

    So are those with too many pixels (``decode.MOST_PIXELS``). Where nothing else is there, the first one is told.
    """

    def __init__(self, name: str, path: str | Path, rate: float) -> None:
        self._name = name
        self._path = Path(path)
        self._rate = rate
        self._left: Iterator[Path] = iter(())
        self._shown = False
        self._trouble: BadRequest | None = None

    def start(self) -> float:
        """List the folder anew; return the seconds between pictures. Raises NotConnected when it holds none."""
        if not self._path.exists():
            hint = f"`ls {self._path.parent}` lists what is there"
            raise NotConnected(f"{self._name}: {self._path}: no such file or folder", hint=hint)
        if self._path.is_dir():
            found = sorted(path for path in self._path.iterdir() if path.suffix.lower() in PICTURES)
        else:
            found = [self._path]
        if not found:
            kinds = " ".join(sorted(PICTURES))
            raise NotConnected(f"{self._name}: {self._path}: holds no pictures", hint=f"pictures end in {kinds}")
        self._left, self._shown, self._trouble = iter(found), False, None
        return 1.0 / self._rate

    def grab(self, wanted: Callable[[], bool]) -> Image | None:
        """Return the next picture that decodes, None after the last: see Feed. Raises NotConnected where none does."""
        for path in self._left:
            if not wanted():
                return UNWANTED
            try:
                image = load(path)
            except BadRequest as error:
                self._trouble = self._trouble or error
            else:
                self._shown = True
                return image
        if self._trouble is not None and not self._shown:
            raise NotConnected(f"{self._name}: gives no picture: {self._trouble}", hint=self._trouble.hint)
        return None

    def stop(self) -> None:
        """Forget the list."""
        self._left = iter(())
