"""``mission doctor --move`` and a head: by the pictures of its camera, an axis that turns the wrong way."""

from collections.abc import Mapping
from dataclasses import replace
from math import radians, tan
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from config.diagnostics import SourceText
from drivers.api import Image
from drivers.api.driver import Finding
from missions.language.document import check_plan
from missions.library.drivers import load_robot
from missions.library.lookups import LOOKUPS
from missions.library.target import target_of
from missions.plugins.setup.doctor.head_trial import PICTURE_WIDTH, TRIAL_POSES, PictureLog, TryHead, reduce_picture
from missions.plugins.setup.doctor.head_verdict import judge_head
from missions.request import RunRequest
from missions.runner import Runner
from tests.tries import tries

VIEW = radians(60)
FOCAL = PICTURE_WIDTH / 2 / tan(VIEW / 2)
HEIGHT = 240


def room(chance: np.random.Generator, contrast: float = 1.0) -> Image:
    """Return what is around a head: furniture of some colours, larger than its picture."""
    size = (3 * HEIGHT, 3 * PICTURE_WIDTH)
    scene = np.full(size, 110, np.float64)
    for _ in range(60):
        x, y = int(chance.integers(0, size[1])), int(chance.integers(0, size[0]))
        w, h = int(chance.integers(8, 120)), int(chance.integers(8, 120))
        scene[y : y + h, x : x + w] += contrast * chance.uniform(-70, 70)
    return np.clip(cv2.GaussianBlur(scene, (0, 0), 1.0), 0, 255).astype(np.uint8)


def filmed(
    chance: np.random.Generator,
    scene: Image,
    *,
    pan: float = 1.0,
    tilt: float = 1.0,
    swapped: bool = False,
    upside_down: bool = False,
    noise: float = 2.0,
    walker: bool = False,
) -> Mapping[str, Image]:
    """Return a picture of each pose: ``pan`` and ``tilt`` are the shares that its axes turn, -1 the wrong way."""
    found = {}
    for name, pose in TRIAL_POSES:
        turned = (pan * pose.pan, tilt * pose.tilt)
        left, down = turned[::-1] if swapped else turned
        x = round(PICTURE_WIDTH - FOCAL * tan(left))
        y = round(HEIGHT + FOCAL * tan(down))
        image = scene[y : y + HEIGHT, x : x + PICTURE_WIDTH].astype(np.float64)
        if walker:
            at = int(chance.integers(0, PICTURE_WIDTH - 60))
            image[40:, at : at + 60] = chance.uniform(20, 230)
        image = image * chance.uniform(0.9, 1.1) + chance.normal(0, noise, image.shape)
        image = image[::-1, ::-1] if upside_down else image
        found[name] = np.clip(image, 0, 255).astype(np.uint8)
    return found


def verdicts(pictures: Mapping[str, Image]) -> dict[str, Finding]:
    return {each.about: each for each in judge_head(pictures.get, VIEW)}


def test_correct_head_is_never_judged_wrong() -> None:
    right = 0
    count = tries(12, most=200)
    for seed in range(count):
        chance = np.random.default_rng(30000 + seed)
        scene = room(chance, chance.uniform(0.3, 1.0))
        found = verdicts(filmed(chance, scene, noise=chance.uniform(0, 6), walker=seed % 3 == 0))
        assert all(each.verdict != "wrong" for each in found.values()), (seed, found)
        right += sum(each.verdict == "ok" for each in found.values())
    assert right >= 0.6 * 2 * count


@pytest.mark.parametrize(("pan", "tilt"), [(-1.0, 1.0), (1.0, -1.0)])
def test_reversed_head_axis_is_found_in_pictures(pan: float, tilt: float) -> None:
    found = 0
    count = tries(12, most=200)
    for seed in range(count):
        chance = np.random.default_rng(1000 + seed)
        told = verdicts(filmed(chance, room(chance), pan=pan, tilt=tilt))
        wrong, right = ("pan", "tilt") if pan < 0 else ("tilt", "pan")
        assert told[right].verdict != "wrong", (seed, told)
        found += told[wrong].message.startswith("turns the wrong way") and "flip" in told[wrong].fix
    assert found >= 0.9 * count


@pytest.mark.parametrize("how", [{"pan": -1.0, "tilt": -1.0}, {"upside_down": True}])
def test_two_reversed_axes_suggest_an_upside_down_camera(how: dict[str, Any]) -> None:
    chance = np.random.default_rng(5)
    (found,) = verdicts(filmed(chance, room(chance), **how)).values()
    assert found.verdict == "wrong"
    assert "upside down" in found.message


def test_swapped_head_servos_are_named() -> None:
    chance = np.random.default_rng(6)
    found = verdicts(filmed(chance, room(chance), swapped=True))
    assert all("swapped" in each.message and each.verdict == "wrong" for each in found.values())


@pytest.mark.parametrize("noise", [0.0, 2.0, 8.0])
def test_blank_wall_gives_an_unknown_direction(noise: float) -> None:
    for seed in range(tries(5, most=100)):
        chance = np.random.default_rng(seed)
        found = verdicts(filmed(chance, room(chance, contrast=0.0), noise=noise))
        assert all("direction unknown" in each.message and each.verdict == "warning" for each in found.values()), (
            seed,
            found,
        )


def test_motionless_head_and_missing_pictures_are_reported() -> None:
    chance = np.random.default_rng(7)
    found = verdicts(filmed(chance, room(chance), pan=0.0, tilt=0.0))
    assert all("did not move" in each.message and each.verdict == "warning" for each in found.values())
    assert all("no picture in" in each.message for each in verdicts({}).values())


# --- in a simulated room ----------------------------------------------------------------------------------------------

ROBOT = """robot: looker
camera: {position: [0 m, 0 m, 0.6 m]}
head:
  driver: arduino
  port: /dev/head
  speed: 120 deg/s
  pan: {servo: 0, limits: [-80 deg, 80 deg]}
  tilt: {servo: 1, limits: [-60 deg, 60 deg]}
"""


@pytest.mark.parametrize("flipped", ["", "pan", "tilt"])
def test_in_a_simulated_room_the_head_is_tried_and_judged(tmp_path: Path, flipped: str) -> None:
    file = tmp_path / "looker.yaml"
    file.write_text(ROBOT)
    config = load_robot(file)
    source = SourceText("doctor", f"mission: doctor\ntree:\n  {TryHead.tag}:\n")
    plan = check_plan(source, {TryHead.tag: TryHead}, LOOKUPS, robot=target_of(config))
    log = PictureLog()
    order = RunRequest("doctor", robot=str(file), simulate="fast", world="living_room")
    runner = Runner(order, plan=plan)
    runner.observe(on_frame=log)
    assert runner.twins is not None
    twin: Any = runner.twins.parts["head"]
    axes = zip(("pan", "tilt"), twin._untrimmed_axes, strict=True)
    twin._untrimmed_axes = tuple(replace(axis, flip=axis.flip is not (name == flipped)) for name, axis in axes)
    result = runner.run()
    assert result.result == "success", result.reason
    leaf = next(node for node in runner.root.iterate() if isinstance(node, TryHead))
    assert all(end - start > 0.5 for start, end in leaf.still_times.values())
    assert config.camera is not None
    told = judge_head(lambda pose: log.within(*leaf.still_times[pose]), config.camera.field_of_view)
    found = {each.about: each for each in told}
    for axis in ("pan", "tilt"):
        if axis == flipped:
            assert found[axis].message.startswith("turns the wrong way"), found
        else:
            assert found[axis].verdict != "wrong", found
    assert found["pan"].message.startswith("turns "), found


def test_pictures_are_reduced_and_found_by_their_time() -> None:
    log = PictureLog()
    for number in range(5):
        log(_frame(np.full((480, 640, 3), 10 * number, np.uint8), float(number)), None)
    found = log.within(1.5, 3.2)
    assert found is not None
    assert (found.shape, int(found[0, 0])) == ((240, 320), 30)
    assert log.within(7.0, 8.0) is None
    assert reduce_picture(np.zeros((100, 64), np.uint8)).shape == (500, 320)


def _frame(image: Image, stamp: float) -> Any:
    class Frame:
        pass

    frame: Any = Frame()
    frame.image, frame.stamp = image, stamp
    return frame
