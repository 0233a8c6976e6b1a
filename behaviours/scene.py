"""Conditions on the whole picture: uniform, dark, or moving."""

from abc import abstractmethod

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from perception.api import Scene


class _PictureCondition(Leaf):
    """Base class of conditions on the newest picture; suspended until a picture is recent enough."""

    instant = True
    needs = frozenset({"camera"})
    senses = frozenset()
    within: float

    def update(self) -> Status:
        scene = self.robot.sight.scene()
        oldest = self.run.now() - max(self.within, self.elapsed)
        if scene is None or scene.stamp < oldest:
            return self.suspend("camera")
        return self.judge(scene)

    @abstractmethod
    def judge(self, scene: Scene) -> Status:
        """Return SUCCESS, or fail with a reason, for a picture."""


class SceneUniform(_PictureCondition):
    """Check whether the picture is uniform, as of a blank wall or a covered lens.

    Succeeds if the newest picture has no edges, fails if it has. It answers at once, and is suspended until a picture
    is recent enough.
    """

    tag = "scene_uniform"
    example = "- scene_uniform: 1 s"
    within: float = argument(
        "duration", "maximum age of the picture; 0 s waits for a new one", default=0.5, principal=True, low=0.0
    )
    contrast: float = argument(
        "number", "maximum difference of neighbouring spots in grey levels of 255", default=6.0, low=0.0, high=255.0
    )

    def judge(self, scene: Scene) -> Status:
        if scene.contrast <= self.contrast:
            self.feedback_message = f"the picture is uniform, with a brightness of {scene.brightness:.0f} of 255"
            return SUCCESS
        return self.fail(f"the picture is not uniform: its contrast is {scene.contrast:.0f}")


class Dark(_PictureCondition):
    """Check whether it is dark.

    Succeeds if the mean brightness of the newest picture is below `below`, fails if not. It answers at once, and is
    suspended until a picture is recent enough.
    """

    tag = "dark"
    example = "- dark: 15 %"
    below: float = argument("share", "brightness limit; 100 % is white", default=0.2, principal=True, low=0.0, high=1.0)
    within: float = argument("duration", "maximum age of the picture; 0 s waits for a new one", default=0.5, low=0.0)

    def judge(self, scene: Scene) -> Status:
        share = scene.brightness / 255
        self.feedback_message = f"the picture has a brightness of {share:.0%}"
        return SUCCESS if share < self.below else self.fail(self.feedback_message)


class MotionSeenLeaf(_PictureCondition):
    """Check whether something moves in the picture.

    Succeeds if at least `share` of the newest picture has changed since the one before, fails if not. The camera's own
    motion is compensated to about 1 %: use `2 %` while the robot moves. It answers at once, and is suspended until a
    picture is recent enough.
    """

    tag = "motion_seen"
    example = "- motion_seen: 2 %"
    senses = frozenset({"motion"})
    share: float = argument(
        "share",
        "share of the picture that must have changed; a person who walks by at 2 m makes 1 %",
        default=0.005,
        principal=True,
        low=0.0,
    )
    within: float = argument("duration", "maximum age of the picture; 0 s waits for a new one", default=0.5, low=0.0)

    def judge(self, scene: Scene) -> Status:
        if scene.motion is None:
            return self.fail("motion detection is off")
        self.feedback_message = f"{scene.motion:.1%} of the picture moves"
        return SUCCESS if scene.motion >= self.share else self.fail(self.feedback_message)
