"""Leaves that show a face and words on the robot's screen."""

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import Mood

MOODS = tuple(mood.value for mood in Mood)


class ScreenLeaf(Leaf):
    """Shows something: for a time, or until something else is shown."""

    needs = frozenset({"screen"})
    drives = frozenset({"screen"})
    ends = frozenset({"success"})
    seconds: float | None = argument(
        "duration", "for how long; else until something else is shown", name="for", default=None, low=0.1
    )

    def update(self) -> Status:
        return SUCCESS if self.seconds is None or self.elapsed >= self.seconds else self.wait("showing it")


class FaceLeaf(ScreenLeaf):
    """Look like a mood.

    Succeeds at once, and the face stays so. With `for` it is running for so long; then, or when it is halted, the face
    is what it was before.
    """

    tag = "face"
    mood: str = argument("choice", "which", principal=True, choices=MOODS)
    _before = Mood.NEUTRAL

    def initialise(self) -> None:
        self._before = self.robot.screen.content().mood
        self.robot.screen.mood(Mood(self.mood))

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS or self.seconds is not None:
            self.robot.screen.mood(self._before)


class Show(ScreenLeaf):
    """Show words below the face.

    Succeeds at once, and the words stay there; an empty text takes them away. With `for` it is running for so long;
    then, or when it is halted, there are none.
    """

    tag = "show"
    text: str = argument("text", "what to show", principal=True)

    def initialise(self) -> None:
        self.robot.screen.show(self.text)

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS or self.seconds is not None:
            self.robot.screen.show("")
