"""The robot's face in a run: a mouth that moves with the voice, and a page."""

import socket
from pathlib import Path
from threading import Event
from urllib.request import urlopen

import pytest

from drivers.api import Mood, Mouth, MouthShape
from drivers.api.driver import DriverContext
from drivers.clock import SystemClock
from drivers.screen.declared import PageKeys
from drivers.screen.make import PrintedScreen, printed
from drivers.screen.make import page as make_page
from drivers.screen.pages import PageScreen
from missions.assembly.face import MOUTH_OPENINGS, MouthAnimation, TalkingScreen
from missions.plugins.testing.recorders import LeafTestBench
from tests.missions.command import command


def test_mouth_follows_the_visemes_and_closes_after_speech() -> None:
    bench = LeafTestBench()
    lips = MouthAnimation(bench.voice, bench.screen, bench.clock)
    lips.step()
    assert bench.screen.commands == []  # it is not told again and again that nobody speaks
    words = bench.voice.say("a moo")
    words.mouth = (MouthShape(0.0, Mouth.OPEN), MouthShape(0.2, Mouth.CLOSED), MouthShape(0.3, Mouth.ROUND))
    for _ in range(4):
        lips.step()
        bench.clock.advance(0.11)
    words.ended = True
    lips.step()
    lips.step()
    assert bench.screen.commands == [1.0, 1.0, 0.0, MOUTH_OPENINGS[Mouth.ROUND], 0.0]


def test_mouth_without_visemes_moves_by_the_clock() -> None:
    bench = LeafTestBench()
    lips = MouthAnimation(bench.voice, bench.screen, bench.clock)
    bench.voice.say("Hello")
    for _ in range(20):
        bench.clock.advance(0.03)
        lips.step()
    openings = [each for each in bench.screen.commands if isinstance(each, float)]
    assert 0.0 <= min(openings) < 0.1
    assert 0.5 < max(openings) <= 0.6


def test_every_mouth_shape_has_an_opening() -> None:
    assert set(MOUTH_OPENINGS) == set(Mouth)


def test_screen_driver_follows_the_robot_file() -> None:
    clock = SystemClock()
    assert isinstance(printed(PageKeys(), DriverContext(clock, print_line=print)), PrintedScreen)
    page = make_page(PageKeys(mood="happy"), DriverContext(clock))
    assert isinstance(page, PageScreen)
    assert page.content().mood is Mood.HAPPY


def test_talking_screen_animates_the_mouth_until_closed() -> None:
    bench = LeafTestBench()
    page = PageScreen(SystemClock())
    moved = Event()
    bench.voice.say("Hello")
    lively = TalkingScreen(page, bench.voice, bench.clock)
    for _ in range(2):  # opened again after it was closed
        lively.open()
        lively.open()
        lively.mood(Mood.HAPPY)
        with urlopen(page.address) as answer:  # noqa: S310 - our own page
            assert answer.status == 200
        for _ in range(200):
            bench.clock.advance(0.01)
            if lively.content().mouth > 0:
                break
            moved.wait(0.02)
        assert lively.content().mouth > 0
        assert lively.content().mood is Mood.HAPPY
        lively.close()
        lively.close()
    assert not lively.health().online


def test_screen_without_a_voice_starts_no_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    def started(**_: object) -> None:
        pytest.fail("a thread for a mouth that nothing moves")

    monkeypatch.setattr("missions.assembly.face.Thread", started)
    bench, told = LeafTestBench(), list[str]()
    lively = TalkingScreen(PageScreen(bench.clock), None, bench.clock, lambda notice: told.append(notice.message))
    for _ in range(2):  # opened again after it was closed
        lively.open()
        lively.open()
        assert lively.health().online
        lively.close()
    assert len(told) == 2


def test_run_continues_with_the_screen_port_in_use(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot, mission = tmp_path / "faced.yaml", tmp_path / "smile.yaml"
    mission.write_text("mission: smile\ntree:\n  sequence:\n    - face: happy\n    - show: Hello\n", encoding="utf-8")
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        robot.write_text(f"robot: faced\nscreen: {{port: {port}}}\n", encoding="utf-8")
        outcome = command(capsys, "run", str(mission), "--robot", str(robot))
    assert outcome.code == 0
    assert (outcome.out + outcome.err).count(f"no page at 127.0.0.1 port {port}") == 1
