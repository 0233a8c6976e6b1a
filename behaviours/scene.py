"""A leaf that asks whether the camera shows anything at all."""

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument


class SceneUniform(Leaf):
    """Does the camera show nothing but one even surface: a blank wall, or a covered lens?

    Succeeds when the newest picture has no edges, fails when it has. Running only until there is a picture that is
    new enough.
    """

    word = "scene_uniform"
    needs = frozenset({"camera"})
    senses = frozenset()
    within: float = argument(
        "duration", "how old the picture may be; 0 s waits for one from now on", default=0.5, principal=True, low=0.0
    )
    contrast: float = argument(
        "number", "grey levels (of 255) that neighbouring spots may differ by", default=6.0, low=0.0, high=255.0
    )

    def update(self) -> Status:
        scene = self.robot.sight.scene()
        oldest = self.run.now() - max(self.within, self.elapsed)
        if scene is None or scene.stamp < oldest:
            return self.wait("waiting for a picture from the camera")
        if scene.contrast <= self.contrast:
            self.feedback_message = f"the picture is uniform, with a brightness of {scene.brightness:.0f} of 255"
            return SUCCESS
        return self.fail(f"the picture shows something: its contrast is {scene.contrast:.0f}")
