"""Orientation of the pictures of a camera that is not mounted upright, and its effect on the lens parameters."""

from math import atan, tan

from drivers.api.fast_dataclass import dataclass

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class ImageOrientation:
    """Clockwise rotation by ``quarter_turns`` (0 to 3), followed by flips: left to right, top to bottom."""

    quarter_turns: int = 0
    flip_horizontal: bool = False
    flip_vertical: bool = False

    def __bool__(self) -> bool:
        return self != ImageOrientation()

    @property
    def swaps_sides(self) -> bool:
        """Whether width and height are swapped."""
        return self.quarter_turns % 2 == 1

    def vector(self, x: float, y: float) -> Pair:
        """Return a vector of the original picture as a vector of the rotated picture.

        Vectors are components to the right and down: ``x`` to the right and ``y`` down in the original picture.
        """
        for _ in range(self.quarter_turns):
            x, y = -y, x
        return (-x if self.flip_horizontal else x), (-y if self.flip_vertical else y)

    def point(self, x: float, y: float) -> Pair:
        """Return the point of the rotated picture that corresponds to a point of the original picture.

        Both are shares of the picture's width and height.
        """
        right, below = self.vector(x - 0.5, y - 0.5)
        return right + 0.5, below + 0.5

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Return the size of the rotated picture, from the size of the original picture.

        The opposite conversion is the same, since a quarter turn swaps width and height.
        """
        return (height, width) if self.swaps_sides else (width, height)

    def field_of_view(self, angle: float, width: int, height: int) -> float:
        """Return the horizontal angle of view (rad) of the rotated picture.

        ``angle`` is that of the original picture; ``width`` and ``height`` are the size of the rotated picture.
        """
        return 2 * atan(tan(angle / 2) * width / height) if self.swaps_sides else angle


UPRIGHT = ImageOrientation()
"""Orientation of a camera that is mounted upright."""
