"""Leaves that ask what the picture shows as a whole: whether it is blank, whether it is dark, whether it moves."""

from abc import abstractmethod

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from perception.api import Scene


class _PictureCondition(Leaf):
    """Judges the newest picture; suspended until there is one that is new enough."""

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
        """Succeed or fail by what the picture shows."""


class SceneUniform(_PictureCondition):
    """Does the camera show nothing but one even surface: a blank wall, or a covered lens?

    Succeeds when the newest picture has no edges, fails when it has. It never runs, and is suspended until there is a
    picture that is new enough.
    """

    tag = "scene_uniform"
    within: float = argument(
        "duration", "how old the picture may be; 0 s waits for one from now on", default=0.5, principal=True, low=0.0
    )
    contrast: float = argument(
        "number", "grey levels (of 255) that neighbouring spots may differ by", default=6.0, low=0.0, high=255.0
    )

    def judge(self, scene: Scene) -> Status:
        if scene.contrast <= self.contrast:
            self.feedback_message = f"the picture is uniform, with a brightness of {scene.brightness:.0f} of 255"
            return SUCCESS
        return self.fail(f"the picture shows something: its contrast is {scene.contrast:.0f}")


class Dark(_PictureCondition):
    """Is it dark?

    Succeeds when the newest picture is darker than that, as a whole, fails when not. It never runs, and is suspended
    until there is a picture that is new enough.
    """

    tag = "dark"
    below: float = argument(
        "share", "how bright the picture may be, 100 % being white", default=0.2, principal=True, low=0.0, high=1.0
    )
    within: float = argument("duration", "how old the picture may be; 0 s waits for one", default=0.5, low=0.0)

    def judge(self, scene: Scene) -> Status:
        share = scene.brightness / 255
        self.feedback_message = f"the picture has a brightness of {share:.0%}"
        return SUCCESS if share < self.below else self.fail(self.feedback_message)


class MotionSeenLeaf(_PictureCondition):
    """Does something move?

    Succeeds when that share of the newest picture has changed since the one before, fails when not. That the camera
    turns is taken off, but for a rest of 1 %: ask for `2 %` while the robot moves. It never runs, and is suspended
    until there is a picture that is new enough.
    """

    tag = "motion_seen"
    senses = frozenset({"motion"})
    share: float = argument(
        "share", "how much must have changed; somebody who walks by at 2 m: 1 %", default=0.005, principal=True, low=0.0
    )
    within: float = argument("duration", "how old the picture may be; 0 s waits for one", default=0.5, low=0.0)

    def judge(self, scene: Scene) -> Status:
        if scene.motion is None:
            return self.fail("the eyes do not look for motion")
        self.feedback_message = f"{scene.motion:.1%} of the picture moves"
        return SUCCESS if scene.motion >= self.share else self.fail(self.feedback_message)
