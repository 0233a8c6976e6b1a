"""Pictures of a robot in physics: by MuJoCo's renderer if EGL is available (without a screen), else a stick figure."""

from contextlib import suppress
from math import cos, degrees, sin
from typing import Any

import cv2
import numpy as np

from drivers.api import Image
from drivers.sim.rigid.scene import PhysicsScene
from drivers.sim.rigid.stick_drawing import Floats, Stroke, draw_stick_figure

AZIMUTH, ELEVATION = 140.0, -15.0
"""Direction of the renderer's camera: degrees from the initial heading of the robot, and from level."""

CAMERA_DISTANCE_FACTOR = 2.0
"""Distance of the camera from the robot, in heights of the robot."""

MAX_GEOMS = 2000
"""Maximum number of shapes in one picture; OP3's model has a few hundred."""

LINE_RADIUS = 0.004
"""Half the width of a line from joint to joint, in metres."""


class BodyCamera:
    """Draws the robot of a scene, centred, in pictures of ``size`` (width, height). For one thread.

    Drawing does not change the scene.
    """

    def __init__(self, scene: PhysicsScene, size: tuple[int, int], *, render: bool = True) -> None:
        self._scene, self._size = scene, size
        self._start_pose = scene.pose()
        self._last_position = (self._start_pose.x, self._start_pose.y)
        self._walked_distance = 0.0
        self._height = max(float(scene.data.geom_xpos[solid, 2]) for solid in _robot_geoms(scene)) * 1.1
        self._renderer = _Renderer(scene, size) if render and _has_egl() else None

    @property
    def is_rendered(self) -> bool:
        """True if MuJoCo's renderer draws, False for the stick figure."""
        return self._renderer is not None

    def draw(self, now: float) -> Image:
        """Return the picture at time ``now`` (s): (height, width, 3), blue, green, red."""
        caption = f"{now:.2f} s"
        if self._renderer is not None:
            image = self._renderer.draw(degrees(self._start_pose.heading) + AZIMUTH, self._height)
            cv2.putText(
                image, caption, (8, self._size[1] - 10), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255,) * 3, 1, cv2.LINE_AA
            )
            return image
        pose = self._scene.pose()
        ahead = (pose.x - self._last_position[0]) * cos(pose.heading) + (pose.y - self._last_position[1]) * sin(
            pose.heading
        )
        self._last_position, self._walked_distance = (pose.x, pose.y), self._walked_distance + ahead
        c, s = cos(pose.heading), sin(pose.heading)
        to_robot = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        here = np.array([pose.x, pose.y, 0.0])
        strokes = [
            Stroke(to_robot @ (begin - here), to_robot @ (end - here), radius)
            for begin, end, radius in _strokes(self._scene)
        ]
        return draw_stick_figure(
            strokes, self._size, height=self._height, walked=self._walked_distance, caption=caption
        )

    def close(self) -> None:
        """Free the renderer's memory. Safe more than once."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


class _Renderer:
    """MuJoCo's renderer on an EGL context."""

    def __init__(self, scene: PhysicsScene, size: tuple[int, int]) -> None:
        engine, self._size, self._physics = scene.engine, size, scene
        self._engine = engine
        self._context: Any = _egl_context_class()(*size)
        self._context.make_current()
        self._scene = engine.MjvScene(scene.model, maxgeom=MAX_GEOMS)
        self._gl = engine.MjrContext(scene.model, engine.mjtFontScale.mjFONTSCALE_100)
        engine.mjr_setBuffer(engine.mjtFramebuffer.mjFB_OFFSCREEN, self._gl)
        self._camera, self._options = engine.MjvCamera(), engine.MjvOption()

    def draw(self, azimuth: float, height: float) -> Image:
        engine, scene, camera = self._engine, self._physics, self._camera
        pose = scene.pose()
        camera.lookat[:] = pose.x, pose.y, height / 2
        camera.distance, camera.azimuth, camera.elevation = CAMERA_DISTANCE_FACTOR * height, azimuth, ELEVATION
        self._context.make_current()
        every = engine.mjtCatBit.mjCAT_ALL
        engine.mjv_updateScene(scene.model, scene.data, self._options, None, camera, every, self._scene)
        width, tall = self._size
        place, pixels = engine.MjrRect(0, 0, width, tall), np.empty((tall, width, 3), np.uint8)
        engine.mjr_render(place, self._scene, self._gl)
        engine.mjr_readPixels(pixels, None, place, self._gl)
        image: Image = np.ascontiguousarray(pixels[::-1, :, ::-1])  # from below, and red first
        return image

    def close(self) -> None:
        self._context.make_current()
        self._gl.free()
        self._context.free()


def _egl_context_class() -> Any:
    from mujoco.egl import GLContext  # noqa: PLC0415 - only for films; the import may fail

    return GLContext


def _has_egl() -> bool:
    """Return whether EGL can draw on this computer; it is tried, since there are several reasons why it may fail."""
    with suppress(Exception):
        context: Any = _egl_context_class()(16, 16)
        context.free()
        return True
    return False


def _robot_geoms(scene: PhysicsScene) -> list[int]:
    """Return the numbers of the robot's shapes: all shapes of the model except planes, which belong to the floor."""
    plane = int(scene.engine.mjtGeom.mjGEOM_PLANE)
    return [each for each in range(scene.model.ngeom) if scene.model.geom_type[each] != plane]


def _strokes(scene: PhysicsScene) -> list[Stroke]:
    """Return the robot as lines: shapes by their longest axes, and lines from joint to joint."""
    model, data, kinds = scene.model, scene.data, scene.engine.mjtGeom
    round_ones = {int(kinds.mjGEOM_CAPSULE), int(kinds.mjGEOM_CYLINDER)}
    plain = {int(kinds.mjGEOM_SPHERE), int(kinds.mjGEOM_BOX), int(kinds.mjGEOM_ELLIPSOID), *round_ones}
    found = [
        Stroke(data.xpos[model.body_parentid[body]].copy(), data.xpos[body].copy(), LINE_RADIUS)
        for body in range(1, model.nbody)
        if model.body_parentid[body]
    ]
    for geom in _robot_geoms(scene):
        if int(model.geom_type[geom]) not in plain:
            continue  # a mesh
        at, turned = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
        if int(model.geom_type[geom]) in round_ones:
            found.append(_stroke_along(at, turned[:, 2] * model.geom_size[geom, 1], float(model.geom_size[geom, 0])))
        else:
            found += _edge_strokes(at, turned, model.geom_size[geom])
    return found


def _edge_strokes(at: Floats, turned: Floats, size: Floats) -> list[Stroke]:
    """Return a shape such as a box as two parallel lines in the direction of its longest side."""
    least, middle, most = np.argsort(size)
    radius = float(size[least] or size[most])  # a sphere has one size alone
    reach = turned[:, most] * max(float(size[most]) - radius, 0.0)
    aside = turned[:, middle] * max(float(size[middle]) - radius, 0.0)
    return [_stroke_along(at + way * aside, reach, radius) for way in (-1, 1)]


def _stroke_along(at: Floats, reach: Floats, radius: float) -> Stroke:
    return Stroke(at - reach, at + reach, radius)
