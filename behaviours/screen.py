"""Leaves that show a face and text on the robot's screen."""

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import Mood

MOODS = tuple(mood.value for mood in Mood)


class ScreenLeaf(Leaf):
    """Base class of leaves that show content for a time, or until other content replaces it."""

    needs = frozenset({"screen"})
    drives = frozenset({"screen"})
    ends = frozenset({"success"})
    seconds: float | None = argument(
        "duration", "display time; by default until other content replaces it", name="for", default=None, low=0.1
    )

    def update(self) -> Status:
        return SUCCESS if self.seconds is None or self.elapsed >= self.seconds else self.wait("showing it")


class FaceLeaf(ScreenLeaf):
    """Show a mood on the robot's face.

    Succeeds at once, and the mood stays. With `for`, it runs for that time; then, or when it is halted, the mood is the
    one from before.
    """

    tag = "face"
    example = "- face: happy"
    mood: str = argument("choice", "mood of the face", principal=True, choices=MOODS)
    _before = Mood.NEUTRAL

    def initialise(self) -> None:
        self._before = self.robot.screen.content().mood
        self.robot.screen.mood(Mood(self.mood))

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS or self.seconds is not None:
            self.robot.screen.mood(self._before)


class Show(ScreenLeaf):
    """Show text below the face.

    Succeeds at once, and the text stays; an empty text clears it. With `for`, it runs for that time; then, or when it
    is halted, the text is cleared.
    """

    tag = "show"
    example = "- show: {text: Welcome, for: 5 s}"
    text: str = argument("text", "text to show; empty clears it", principal=True)

    def initialise(self) -> None:
        self.robot.screen.show(self.text)

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS or self.seconds is not None:
            self.robot.screen.show("")
