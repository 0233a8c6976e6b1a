"""``mission person``: adding people from pictures and before a camera, listing and forgetting them."""

import json
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from missions.cli.root import run_guarded
from missions.library.people import People
from missions.plugins.setup import person
from missions.plugins.setup.person.add import (
    INSTRUCTIONS,
    PICTURE_INTERVAL,
    SAME_PICTURE,
    TOO_SIMILAR,
    TOO_SOON,
    PortraitCollector,
)
from perception.api import Image
from perception.haar_faces import HaarFaceDetector
from tests.missions.command import Outcome
from tests.perception.people_drawn import crowd, pictures

NOBODY = np.full((480, 640, 3), 120, np.uint8)


@dataclass
class Bench:
    """A user's data folder, and pictures beside it."""

    folder: Path
    people: People
    capsys: pytest.CaptureFixture[str]

    def run(self, *words: str) -> Outcome:
        self.capsys.readouterr()
        code = run_guarded(lambda: person.command.main(list(words), standalone_mode=False))
        printed = self.capsys.readouterr()
        return Outcome(code, printed.out, printed.err)

    def write(self, name: str, *images: Image) -> list[str]:
        """Write pictures, and return their paths."""
        found = [self.folder / f"{name}{number}.png" for number in range(len(images))]
        for path, image in zip(found, images, strict=True):
            assert cv2.imwrite(str(path), image)
        return [str(path) for path in found]


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Bench:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return Bench(tmp_path, People(tmp_path / "data/missiontree/people"), capsys)


@cache
def near(look: str) -> list[Image]:
    return pictures(look, (1.0, 1.3), each=2)


def test_person_is_added_listed_and_removed(bench: Bench) -> None:
    outcome = bench.run("add", "Anna", *bench.write("anna", *near("anna")))
    assert outcome.code == 0
    assert "4 of 6 recommended pictures" in outcome.err
    assert outcome.out.startswith("Anna: 4 pictures saved in ")
    assert bench.run("add", "Ben", *bench.write("ben", *near("ben"))).code == 0
    listed = bench.run("list")
    assert [line.split()[:2] for line in listed.out.splitlines()[1:3]] == [["Anna", "4"], ["Ben", "4"]]
    assert "of 100 looks at known people" in listed.out
    assert "of 100 looks at strangers" in listed.out
    data = json.loads(bench.run("list", "--json").out)
    assert [each["name"] for each in data["people"]] == ["Anna", "Ben"]
    assert 0 <= data["rates"]["refused"] <= 1
    assert bench.run("remove", "anna", "--yes").out == "Anna: 4 pictures deleted\n"
    assert [each.name for each in bench.people.known_people()] == ["Ben"]


def test_pictures_without_exactly_one_face_are_refused(bench: Bench) -> None:
    good, bad = bench.write("good", *near("anna")), bench.write("bad", NOBODY, crowd("anna", "ben"))
    outcome = bench.run("add", "Anna", *good, *bad)
    assert outcome.code == 1
    assert f"{bad[0]}: it shows no face" in outcome.err
    assert f"{bad[1]}: there are 2 faces in it" in outcome.err
    assert good[0] not in outcome.err
    assert not bench.people.folder.exists()


def test_too_few_pictures_are_refused(bench: Bench) -> None:
    outcome = bench.run("add", "Anna", *bench.write("anna", *near("anna")[:2]))
    assert outcome.code == 1
    assert "too few pictures of Anna: 2, where each counts once\n  try: at least 3 are needed" in outcome.err
    assert not bench.people.folder.exists()


def test_the_same_picture_three_times_is_one(bench: Bench) -> None:
    outcome = bench.run("add", "Anna", *bench.write("anna", *[near("anna")[0]] * 3))
    assert outcome.code == 1
    assert "too few pictures of Anna: 1" in outcome.err
    assert not bench.people.folder.exists()


def test_duplicate_pictures_are_skipped(bench: Bench) -> None:
    first, *others = bench.write("anna", *near("anna"))
    bench.run("add", "Anna", *others)
    outcome = bench.run("add", "Anna", first, *others)
    assert outcome.code == 0
    assert outcome.out.startswith("Anna: 1 pictures saved in ")
    assert outcome.out.endswith(", 3 before\n")
    assert outcome.err.startswith("3 duplicate pictures skipped\n")


def test_picture_of_another_person_is_refused(bench: Bench) -> None:
    bench.run("add", "Anna", *bench.write("anna", *near("anna")))
    outcome = bench.run("add", "Ben", *bench.write("ben", *near("ben"), near("anna")[0]))
    assert outcome.code == 1
    assert "nothing was stored: one of the pictures of Ben is already stored for Anna" in outcome.err
    assert [each.name for each in bench.people.known_people()] == ["Anna"]


def test_unreadable_portrait_is_reported_and_skipped(bench: Bench) -> None:
    bench.run("add", "Anna", *bench.write("anna", *near("anna")))
    (bench.people.folder / "Anna/002.png").write_bytes(b"no picture")
    outcome = bench.run("list")
    assert outcome.code == 0
    assert "Anna/002.png: is not a portrait; it is skipped\n  try: rm " in outcome.err
    assert "of 100 looks at known people" in outcome.out
    (bench.people.folder / "Anna/001.png").unlink()
    outcome = bench.run("list")
    assert "Anna: 2 pictures are too few: at least 3 are needed" in outcome.err
    assert outcome.out.splitlines()[-1].split()[:2] == ["Anna", "3"]


def test_removed_persons_other_files_are_kept_and_reported(bench: Bench) -> None:
    bench.run("add", "Anna", *bench.write("anna", *near("anna")))
    letter = bench.people.folder / "Anna/letter.txt"
    letter.touch()
    outcome = bench.run("remove", "Anna", "--yes")
    assert outcome.out == "Anna: 4 pictures deleted\n"
    assert outcome.err == f"{letter.parent} is kept: it has other files\n"
    assert letter.exists()


def test_look_alike_of_a_known_person_is_reported(bench: Bench) -> None:
    bench.run("add", "Anna", *bench.write("anna", *near("anna")))
    outcome = bench.run("add", "Zoe", *bench.write("twin", *pictures("anna", (1.1, 1.2), each=2)))
    assert outcome.code == 0
    assert "Zoe looks like Anna" in outcome.err


def test_too_similar_pictures_are_reported(bench: Bench) -> None:
    good = near("anna")[0]
    random = np.random.default_rng(1)
    noisy = [np.asarray(np.clip(good + random.normal(0, 3, good.shape), 0, 255), np.uint8) for _ in range(6)]
    outcome = bench.run("add", "Anna", *bench.write("anna", *noisy))
    assert "6 pictures are enough" in outcome.err
    assert "the pictures of Anna are too similar" in outcome.err
    assert "looks like" not in outcome.err


def test_person_command_reports_a_method_other_than_the_robots(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    robots = bench.folder / "robots"
    robots.mkdir()
    for name, method in (("plain", "patches"), ("deep", "dlib")):
        identity = f"{{people: {bench.people.folder}, method: {method}}}"
        (robots / f"{name}.yaml").write_text(f"robot: {name}\ncamera:\n  identity: {identity}\n")
    monkeypatch.chdir(bench.folder)
    bench.run("add", "Anna", *bench.write("anna", *near("anna")))
    twin = bench.write("twin", *pictures("anna", (1.1, 1.2), each=2))
    told = "tested with patches; the robot's method dlib was not tested"
    assert told in bench.run("list", "--robot", "robots/deep.yaml").out
    assert told in bench.run("add", "Zoe", *twin, "--robot", "robots/deep.yaml").err
    assert "judged" not in bench.run("list", "--robot", "robots/plain.yaml").out
    assert "judged" not in bench.run("list").out


def test_reserved_name_is_refused_before_the_camera_opens(bench: Bench) -> None:
    outcome = bench.run("add", "unknown", "--camera", "/nowhere.mp4")
    assert outcome.code == 1
    assert "'unknown' is reserved for strangers" in outcome.err


@pytest.mark.real_time
def test_person_is_guided_before_the_camera(bench: Bench) -> None:
    folder = bench.folder / "film"
    folder.mkdir()
    for number, image in enumerate([NOBODY, *near("anna") * 5]):
        assert cv2.imwrite(str(folder / f"{number:02}.png"), image)
    outcome = bench.run("add", "Anna", "--camera", str(folder), "--count", "3", "--seconds", "60")
    assert outcome.code == 0, outcome.err
    assert "Look straight into the camera." in outcome.err
    assert "waiting: it shows no face" in outcome.err
    assert [each.pictures for each in bench.people.known_people()] == [3]


def test_portrait_collector_gives_instructions_and_reasons() -> None:
    taking = PortraitCollector(HaarFaceDetector(), count=3)
    good = near("anna")[0]
    assert taking.instruction == INSTRUCTIONS[0]
    assert taking.offer(NOBODY, 0.0) == "it shows no face"
    assert taking.offer(crowd("anna", "ben"), 0.1) == "there are 2 faces in it"
    blurred = np.asarray(cv2.GaussianBlur(good, (0, 0), 5), np.uint8)
    assert "blurred" in taking.offer(blurred, 0.2)
    assert taking.offer(good, 0.3) == ""
    assert taking.offer(good, 0.3 + PICTURE_INTERVAL / 2) == TOO_SOON
    assert taking.instruction == INSTRUCTIONS[2]
    assert taking.offer(good, 0.3 + 1.01 * PICTURE_INTERVAL) == SAME_PICTURE
    for number, picture in enumerate(near("anna")[1:3], start=1):
        assert taking.offer(picture, 0.3 + number * PICTURE_INTERVAL + 0.01 * number) == ""
    assert taking.is_complete
    assert len(taking.portraits) == 3


def test_portrait_collector_refuses_too_similar_pictures() -> None:
    taking, good = PortraitCollector(HaarFaceDetector(), count=3), near("anna")[0]
    noise = np.random.default_rng(1).normal(0, 2, good.shape)
    again = np.asarray(np.clip(good + noise, 0, 255), np.uint8)
    assert taking.offer(good, 0.0) == ""
    assert taking.offer(again, 2 * PICTURE_INTERVAL) == TOO_SIMILAR
    assert taking.instruction == INSTRUCTIONS[len(INSTRUCTIONS) // 3]
    assert taking.offer(near("anna")[2], 3 * PICTURE_INTERVAL) == ""


@pytest.mark.real_time
def test_portrait_instructions_are_spoken_on_request(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    voice = SimpleNamespace(open=lambda: None, say=said.append, close=lambda: said.append("closed"))
    monkeypatch.setattr(sys.modules["missions.plugins.setup.person.add"], "make_voice", lambda *_, **__: voice)
    folder = bench.folder / "film"
    folder.mkdir()
    for number, image in enumerate(near("anna") * 5):
        assert cv2.imwrite(str(folder / f"{number:02}.png"), image)
    outcome = bench.run("add", "Anna", "--camera", str(folder), "--count", "3", "--say")
    assert outcome.code == 0, outcome.err
    assert said == [
        INSTRUCTIONS[0],
        INSTRUCTIONS[len(INSTRUCTIONS) // 3],
        INSTRUCTIONS[2 * len(INSTRUCTIONS) // 3],
        "closed",
    ]


def test_unknown_name_or_missing_consent_removes_no_person(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.run("add", "Anna", *bench.write("anna", *near("anna")))
    outcome = bench.run("remove", "Anna", "Bob", "--yes")
    assert outcome.code == 1
    assert "unknown person 'Bob'; nothing was deleted" in outcome.err
    monkeypatch.setattr("click.confirm", lambda _: False)
    assert bench.run("remove", "Anna").code == 1
    assert [each.name for each in bench.people.known_people()] == ["Anna"]


def test_empty_list_of_people_gives_a_hint(bench: Bench) -> None:
    assert "mission person add NAME" in bench.run("list").err
    assert json.loads(bench.run("list", "--json").out) == {"people": [], "rates": None}
