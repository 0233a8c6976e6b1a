"""A camera that shows the pictures of a folder, or one picture, at a steady rate."""

from collections.abc import Callable, Iterator
from math import radians
from pathlib import Path

from drivers.api import Image, Report, ignore
from drivers.camera.decode import UNWANTED, load
from drivers.camera.source import PICTURES
from drivers.camera.threaded import ThreadedCamera
from drivers.clock import Clock
from drivers.errors import BadRequest, NotConnected


class FolderFeed:
    """The pictures of a folder in the order of their names, or one picture. Files that do not decode are skipped.

    So are those with too many pixels (``decode.MOST_PIXELS``). Where nothing else is there, the first one is told.
    """

    def __init__(self, name: str, path: Path, rate: float) -> None:
        self._name = name
        self._path = path
        self._rate = rate
        self._left: Iterator[Path] = iter(())
        self._shown = False
        self._trouble: BadRequest | None = None

    @property
    def what(self) -> str:
        """The path."""
        return str(self._path)

    @property
    def hint(self) -> str:
        """What to type next when no picture decodes."""
        return f"`file {self._path / '*' if self._path.is_dir() else self._path}` shows what is in there"

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


class FolderCamera(ThreadedCamera):
    """Shows the pictures at ``path`` (a folder, or one picture), ``rate`` a second; meets ``drivers.api.Camera``.

    With ``loop`` it goes on for ever, and lists the folder anew in each round. Raises BadRequest unless ``rate`` > 0.
    """

    def __init__(
        self,
        path: str | Path,
        clock: Clock,
        *,
        rate: float = 5.0,
        name: str = "camera",
        field_of_view: float = radians(60.0),
        loop: bool = True,
        retry: float = 1.0,
        report: Report = ignore,
    ) -> None:
        if rate <= 0:
            raise BadRequest(f"{name}: {rate} pictures a second: must be above 0")
        super().__init__(
            lambda: FolderFeed(name, Path(path), rate),
            clock,
            name=name,
            field_of_view=field_of_view,
            loop=loop,
            retry=retry,
            report=report,
        )
