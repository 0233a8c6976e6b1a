"""What somebody lets go wrong with a run while it goes on, by name."""

import shlex
import signal
from pathlib import Path

import pytest

from missions.control import sockets
from missions.control.commands import BadMessage
from missions.executive.events import Event, FaultRaised
from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS
from missions.plugins.testing.live_faults import LiveFaults
from missions.request import RunRequest
from missions.runner import Runner
from tests.browser import Browser
from tests.missions.command import Process, command
from tests.missions.studio.page import Page
from tests.missions.studio.serving import Served
from tests.waiting import wait_until

SAYS = "mission: says\ntree:\n  sequence:\n    - say: Hello\n    - wait: 4 s\n"


def runner_of(folder: Path, told: list[Event], simulate: str = "fast") -> Runner:
    path = folder / "says.yaml"
    path.write_text(SAYS, encoding="utf-8")
    order = RunRequest(str(path), simulate="fast" if simulate == "fast" else "wire")
    return Runner(order, listeners=[told.append], limits=IN_PROCESS_LIMITS)


def faults_of(runner: Runner) -> LiveFaults:
    return LiveFaults(runner, lambda function: function())


def test_injected_fault_lasts_for_its_duration(tmp_path: Path) -> None:
    told: list[Event] = []
    runner = runner_of(tmp_path, told)
    faults = faults_of(runner)
    assert runner.twins is not None
    runner.twins.timeline.call_at(3.0, lambda: faults.inject("voice unplugged 500 ms"))
    assert runner.run().result == "success"
    notices = [(event.status, event.t) for event in told if isinstance(event, FaultRaised) and event.t > 1]
    assert [what for what, _ in notices] == ["offline", "online"]
    assert notices[1][1] - notices[0][1] == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    ("words", "error", "message"),
    [
        ("camera frozen 2 s", "unsupported", "'camera frozen 2 s' is unsupported: 'says' uses screen, voice"),
        ("voice unplugd", "bad_field", "the fault of the voice cannot be 'unplugd'; did you mean 'unplugged'?"),
        ("run stopped", "bad_field", "'run stopped' needs an end"),
        ("arm turned elbw to 3 deg", "bad_field", "no joint 'elbw'; did you mean 'elbow'?"),
    ],
)
def test_impossible_fault_is_refused_by_error_name(tmp_path: Path, words: str, error: str, message: str) -> None:
    with pytest.raises(BadMessage) as caught:
        faults_of(runner_of(tmp_path, [])).inject(words)
    assert caught.value.error == error
    assert message in str(caught.value)


@pytest.mark.parametrize("robot", ["turtlebot2_arm", "humanoid"])
def test_whatever_is_offered_can_be_had(robot: str) -> None:
    faults = faults_of(Runner(RunRequest("wave" if robot == "humanoid" else "greet", robot=robot, simulate="fast")))
    offered = faults.examples_answer()["examples"]
    assert isinstance(offered, list)
    assert {words.partition(" ")[0] for words in offered} > {"arm", "run"}
    for words in offered:
        faults.inject(words)


def test_virtual_devices_offer_nothing_but_the_command_for_the_same_run_in_simulated_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "my own"
    folder.mkdir()
    path = folder / "says it.yaml"
    path.write_text("mission: other_name\nparams: {text: {type: text}}\ntree:\n  say: ${text}\n", encoding="utf-8")
    runner = Runner(
        RunRequest(str(path), params={"text": "Good day"}, robot="turtlebot2", simulate="wire"),
        limits=IN_PROCESS_LIMITS,
    )
    faults = faults_of(runner)
    told = faults.examples_answer()
    assert told["examples"] == []
    with pytest.raises(BadMessage, match="unsupported: 'other_name' does not run in simulated time") as caught:
        faults.inject("voice hanging")
    assert caught.value.hint == told["command"]
    words = shlex.split(str(told["command"]))
    assert words[0] == "mission"
    done = command(capsys, *words[1:], "--speed", "1000")  # the command works as it is printed
    assert (done.code, "other_name" in done.out + done.err) == (0, True)


def test_a_fault_is_chosen_on_the_page_and_happens(browser: Browser, served: Served, tmp_path: Path) -> None:
    path, events = tmp_path / "says.yaml", tmp_path / "events.jsonl"
    path.write_text(SAYS.replace("4 s", "1000 s"), encoding="utf-8")
    process = Process("run", str(path), "--simulate", "fast", "--speed", "1", "--events", str(events))
    try:
        wait_until(lambda: sockets.socket_path(str(process.process.pid)).exists() and '"tick"' in events.read_text())
        page = Page(browser, served, view="#robot")
        page.wait_for("says", "voice unplugged")
        choose = "const what = document.querySelector('.faults select'); what.value = 'voice unplugged';"
        page.tab.evaluate(f"{choose} what.dispatchEvent(new Event('change'))")
        page.press("Inject fault")
        page.wait_for("Injected: voice unplugged 2 s")
        wait_until(lambda: events.read_text().count('"online"') == 2)
        viewer = Page(browser, served, served.viewer, view="#robot")
        viewer.wait_for("voice unplugged")
        assert not viewer.enabled("Inject fault")
    finally:
        process.end(signal.SIGTERM)


def test_fault_command_reaches_a_run_of_another_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, events = tmp_path / "says.yaml", tmp_path / "events.jsonl"
    path.write_text(SAYS.replace("4 s", "1000 s"), encoding="utf-8")
    process = Process("run", str(path), "--simulate", "fast", "--speed", "1", "--events", str(events))
    try:
        run = str(process.process.pid)
        wait_until(lambda: sockets.socket_path(run).exists() and '"tick"' in events.read_text())
        assert command(capsys, "simulate", "fault", "--run", run, "voice", "unplugged", "200", "ms").code == 0
        wait_until(lambda: events.read_text().count('"online"') == 2)
        refused = command(capsys, "simulate", "fault", "--run", run, "head", "unplugged")
        assert refused.code == 1
        assert "'head unplugged' is unsupported: 'says' uses screen, voice" in refused.err
    finally:
        process.end(signal.SIGTERM)
    assert command(capsys, "simulate", "fault", "--run", "nobody", "voice", "unplugged").err == "no such run\n"
