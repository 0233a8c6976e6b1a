"""How the pictures of a camera are turned and mirrored that is not mounted upright, and what that makes of its lens."""

from math import atan, tan

from drivers.api.quick import dataclass

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Turn:
    """A turn by so many ``quarters`` clockwise (0 to 3), and then a mirror image: left to right, top to bottom."""

    quarters: int = 0
    across: bool = False
    down: bool = False

    def __bool__(self) -> bool:
        return self != Turn()

    @property
    def sideways(self) -> bool:
        """Whether width and height change places."""
        return self.quarters % 2 == 1

    def vector(self, x: float, y: float) -> Pair:
        """Return a vector of the picture (to the right, down) as it is in the turned one."""
        for _ in range(self.quarters):
            x, y = -y, x
        return (-x if self.across else x), (-y if self.down else y)

    def point(self, x: float, y: float) -> Pair:
        """Return a point of the picture, in shares of its sides, as it is in the turned one."""
        right, below = self.vector(x - 0.5, y - 0.5)
        return right + 0.5, below + 0.5

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Return the size of the turned picture, or of the one that was turned."""
        return (height, width) if self.sideways else (width, height)

    def view(self, angle: float, width: int, height: int) -> float:
        """Return the horizontal angle of view of a turned picture of this size, from that of the camera (rad)."""
        return 2 * atan(tan(angle / 2) * width / height) if self.sideways else angle


UPRIGHT = Turn()
"""No turn at all."""
