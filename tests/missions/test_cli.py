"""The ``mission`` command as its users meet it: what it prints, its exit codes, and no traceback for their slips."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import requires
from pathlib import Path

import cv2
import pytest
import skimage
from dynamixel_sdk import COMM_SUCCESS, PacketHandler, PortHandler
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from behaviours.catalogue import LEAVES
from config.defaults import config_folder
from config.library import find_file
from missions.cli.commands import declared_commands
from missions.language.nodes import FAILURE_NAME
from missions.language.operators import FUNCTIONS
from missions.language.steps import BESIDE_KEYS
from tests.missions.command import Outcome, Process, command, events_of
from tests.waiting import wait_until

Mission = Callable[..., Outcome]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    """The command, run in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: command(capsys, *arguments)


def write(name: str, tree: str) -> str:
    """Write a mission with this tree; return the name of its file."""
    Path(name).write_text(f"mission: {name}\ntree:\n{tree}")
    return name


def test_help_lists_every_command_without_heavy_imports() -> None:
    code = (
        "import sys, missions.__main__ as m; sys.argv = ['mission', '--help']\ntry: m.main()\nexcept SystemExit: pass\n"
    )
    code += "print([name for name in sys.modules if name in ('cv2', 'numpy', 'py_trees', 'yaml', 'rich')])"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert all(f"  {name} " in out for name, _ in declared_commands() if " " not in name)
    assert out.rstrip().endswith("[]")


@pytest.mark.parametrize(("given", "kept"), [("", "4"), ("20", "20")])
def test_openblas_thread_timeout_is_set_unless_given(given: str, kept: str) -> None:
    code = "import os, sys, missions.__main__ as m; sys.argv = ['mission', '--version']\n"
    code += "try: m.main()\nexcept SystemExit: print(os.environ['OPENBLAS_THREAD_TIMEOUT'])"
    others = {name: value for name, value in os.environ.items() if name != "OPENBLAS_THREAD_TIMEOUT"}
    environment = others | ({"OPENBLAS_THREAD_TIMEOUT": given} if given else {})
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.split()[-1] == kept


def test_every_command_has_its_own_help(mission: Mission) -> None:
    for name, _ in declared_commands():
        outcome = mission(*name.split(), "--help")
        assert outcome.code == 0
        assert len(outcome.out.splitlines()) > 4
        assert "\\" not in outcome.out, name


def test_misspelt_command_is_a_usage_error(mission: Mission) -> None:
    outcome = mission("rum", "greet")
    assert outcome.code == 2
    assert "'rum'" in outcome.err


def test_unknown_mission_gives_a_suggestion(mission: Mission) -> None:
    outcome = mission("run", "gret")
    assert (outcome.code, outcome.err) == (2, "mission: unknown mission 'gret'; did you mean 'greet'?\n")


def test_an_unknown_robot_world_param_and_part_are_usage_errors(mission: Mission) -> None:
    assert "unknown robot" in mission("run", "greet", "--robot", "marvin").err
    assert "unknown world" in mission("run", "greet", "--world", "moon").err
    outcome = mission("run", "greet", "--param", "patiense=5 s")
    assert outcome.code == 2
    assert "did you mean 'patience'?" in outcome.err
    assert "needs a duration" in mission("run", "greet", "--param", "patience=5 m").err
    assert mission("run", "greet", "--param", "patience").code == 2


def test_check_reports_all_mistakes_of_all_files_and_exits_with_2(mission: Mission) -> None:
    write("one.yaml", "  sequence:\n    - tyrn: 90 deg\n    - wait: 3\n")
    write("two.yaml", "  wiat: 3 s\n")
    outcome = mission("check", "one.yaml", "two.yaml", "greet")
    assert outcome.code == 2
    assert [line.split(": ")[0] for line in outcome.err.splitlines() if line.startswith(("one", "two"))] == [
        "one.yaml:4:7",
        "one.yaml:5:13",
        "two.yaml:3:3",
    ]
    assert "greet: good" in outcome.out
    assert "3 errors" in outcome.err


def test_check_of_a_folder_checks_every_mission_in_it(mission: Mission) -> None:
    write("good.yaml", "  succeed\n")
    write("bad.yaml", "  suceed\n")
    for name, text in {"lab.yaml": "world: lab\n", "mine.yaml": "robot: mine\n"}.items():
        Path(name).write_text(text, encoding="utf-8")
    outcome = mission("check", ".")
    assert outcome.code == 2
    assert "1 error" in outcome.err
    assert "lab" not in outcome.out + outcome.err
    assert "good.yaml: good" in outcome.out
    assert "bad.yaml:3:3" in outcome.err


def test_error_of_a_mission_that_others_run_is_reported_once(mission: Mission) -> None:
    Path("inner.yaml").write_text(
        "mission: inner\nparams:\n  facts: [{name: a, in: b}]\ntree:\n  sequence:\n"
        "    - for_each: {in: facts, as: f, do: {say: '${f.name}'}}\n    - set: {turned: 3}\n"
        "returns: {turned: turned}\n",
        encoding="utf-8",
    )
    write("outer.yaml", "  sequence:\n    - mission: inner\n    - mission: inner\n    - say: ${turned}\n")
    cases = "tests: inner\ncases:\n  - case: a\n    expect: {result: success, returns: {turned: 3}}\n"
    Path("inner.test.yaml").write_text(cases, encoding="utf-8")
    outcome = mission("check", ".")
    assert outcome.code == 2
    assert outcome.err.count("param 'facts': a key cannot be 'in', which is reserved in expressions") == 1
    assert "outer.yaml: 1 error as above" in outcome.err
    assert outcome.err.endswith("\n1 error\n")
    assert len(json.loads(mission("check", ".", "--json").out)) == 1


def test_result_hidden_by_a_param_gives_a_hint(mission: Mission) -> None:
    text = "mission: inc\nparams: {n: {type: count}}\ntree: {set: {k: '${n + 1}'}}\nreturns: {n: k}\n"
    Path("inc.yaml").write_text(text, encoding="utf-8")
    tree = "  sequence:\n    - mission: inc\n      with: {n: 1}\n      returns: {m: %s}\n    - say: ${m}\n"
    hint = "hint: out.yaml:4:7: 'returns' beside 'inc' reads the variable 'n', and not the result of this name"
    for result, is_hint in (("n", True), ("n + 1", True), ("k", False)):
        write("out.yaml", tree % result)
        outcome = mission("check", "out.yaml")
        assert outcome.code == 0
        assert (hint in outcome.err) == is_hint


def test_check_without_a_robot_uses_the_default_robot(mission: Mission) -> None:
    write("knee.yaml", "  move_joints: {to: {right_elbow: 10 deg}}\n")
    write("toe.yaml", "  move_joints: {to: {left_toe: 10 deg}}\n")
    write("wave.yaml", "  gesture: wave\n")
    knee, toe, wave = (mission("check", f"{name}.yaml") for name in ("knee", "toe", "wave"))
    assert [knee.code, toe.code, wave.code] == [2, 2, 2]
    assert "robot 'turtlebot2_arm': the arm has no joint 'right_elbow'" in knee.err
    assert (
        "knee.yaml was checked for the default robot (turtlebot2_arm); robot 'humanoid' can do it: "
        "`mission run knee.yaml --robot humanoid --simulate`" in knee.err
    )
    assert "toe.yaml was checked for the default robot (turtlebot2_arm); for another robot: --robot NAME" in toe.err
    assert "robot 'humanoid' can do it" in wave.err
    assert mission("check", "knee.yaml", "--robot", "humanoid").code == 0
    assert mission("run", "knee.yaml").code == 2, "a run takes the usual robot too"


def test_check_of_a_shipped_gesture_mission_names_its_robot(mission: Mission) -> None:
    outcome = mission("check", "wave")
    assert (outcome.code, outcome.out) == (0, "wave: good (wave, 5 nodes, for robot 'humanoid')\n")


def test_mission_that_the_robot_cannot_do_is_refused(mission: Mission) -> None:
    Path("legless.yaml").write_text("robot: legless\nvoice: {driver: print}\n")
    outcome = mission("run", "greet", "--robot", "legless.yaml", "--simulate")
    assert outcome.code == 2
    assert "'find_face' needs a head; robot 'legless' has none" in outcome.err


def test_the_json_summary_is_the_last_line_and_alone_on_stdout(mission: Mission) -> None:
    write("ok.yaml", "  sequence:\n    - say: one\n    - wait: 100 ms\n")
    outcome = mission("run", "ok.yaml", "--json")
    assert outcome.code == 0
    (summary,) = events_of(outcome.out.splitlines())
    assert summary.keys() == {"mission", "result", "reason", "seconds", "ticks"}
    assert (summary["mission"], summary["result"], summary["reason"]) == ("ok.yaml", "success", "")
    assert summary["ticks"] > 2
    assert "one" in outcome.err


def test_failed_run_exits_with_1_and_a_reason(mission: Mission) -> None:
    write("bad.yaml", "  sequence:\n    - succeed\n    - fail: out of biscuits\n")
    outcome = mission("run", "bad.yaml", "--json")
    assert outcome.code == 1
    assert events_of(outcome.out.splitlines())[0]["reason"] == "out of biscuits"


def test_invalid_mission_exits_with_2_and_a_json_summary(mission: Mission) -> None:
    write("bad.yaml", "  suceed\n")
    outcome = mission("run", "bad.yaml", "--json")
    assert outcome.code == 2
    assert events_of(outcome.out.splitlines())[0]["result"] == "error"


def test_missing_device_exits_with_3_and_a_hint(mission: Mission, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missions.assembly.assembled_robot.CONNECT_TIMEOUT", 0.5)
    Path("far.yaml").write_text("robot: far\nbase: {driver: kobuki, port: /dev/no_such_base}\n")
    write("go.yaml", "  drive: 1 m\n")
    outcome = mission("run", "go.yaml", "--robot", "far.yaml", "--json")
    assert outcome.code == 3
    assert "/dev/no_such_base: no such device" in outcome.err
    assert "try: " in outcome.err
    assert events_of(outcome.out.splitlines())[0]["result"] == "error"


def test_events_file_has_all_events_in_order(mission: Mission) -> None:
    write("story.yaml", "  sequence:\n    - pretend: [running, success]\n      name: first\n    - say: hi\n")
    assert mission("run", "story.yaml", "--events", "story.jsonl").code == 0
    events = events_of(Path("story.jsonl").read_text().splitlines())
    assert all("event" in event and event["t"] >= 0 for event in events)
    assert [event["t"] for event in events] == sorted(event["t"] for event in events)
    assert (events[0]["event"], events[-1]["event"]) == ("started", "ended")
    changes = [(event["node"], event["status"]) for event in events if event["event"] == "node_changed"]
    assert changes == [
        ("1.1", "running"),
        ("1", "running"),
        ("1.1", "success"),
        ("1.2", "running"),
        ("1.2", "success"),
        ("1", "success"),
    ]
    first = next(event for event in events if event.get("node") == "1.1")
    assert (first["name"], first["kind"], first["line"], first["tick"]) == ("first", "pretend", 4, 1)
    (spoken,) = (event for event in events if event["event"] == "command")
    assert (spoken["to"], spoken["source"], spoken["values"]) == ("voice", "say (1.2)", {"say": "hi"})
    ticks = [event["tick"] for event in events if event["event"] == "tick"]
    assert ticks == list(range(1, len(ticks) + 1))


def test_unwritable_events_file_is_a_usage_error(mission: Mission) -> None:
    outcome = mission("run", "greet", "--events", "no/such/folder/e.jsonl")
    assert outcome.code == 2
    assert "there is no folder" in outcome.err


def test_catalogue_lists_leaves_with_arguments_units_and_claims(mission: Mission) -> None:
    listed = mission("list", "behaviours").out
    assert all(word in listed for word in LEAVES)
    one = mission("show", "behaviour", "drive").out
    assert "distance: length (m, cm, mm); must be given; may stand alone" in one
    assert "speed: speed (m/s, cm/s, mm/s), 0.01 m/s to 0.7 m/s; default 0.2 m/s" in one
    assert "claims: base" in one
    entries = {entry["name"]: entry for entry in json.loads(mission("list", "behaviours", "--json").out)}
    assert entries.keys() == LEAVES.keys()
    assert entries["find_face"]["claims"] == ["head"]


def test_every_leaf_and_argument_has_help() -> None:
    for word, leaf in LEAVES.items():
        assert leaf.tag == word
        assert (leaf.__doc__ or "").strip(), word
        assert all(argument.help for argument in leaf.arguments.values()), word


@pytest.mark.parametrize("word", [*BESIDE_KEYS, *FUNCTIONS, FAILURE_NAME, "sequence", "timeout"])
def test_show_explains_each_word_of_the_language(mission: Mission, word: str) -> None:
    outcome = mission("show", word)
    assert outcome.code == 0
    assert re.match(rf"{word}(\(.+\))?( or {word}\(.+\))?: \w", outcome.out)


def test_unknown_behaviour_gives_a_suggestion(mission: Mission) -> None:
    outcome = mission("show", "behaviour", "trak_face")
    assert outcome.code == 2
    assert "did you mean 'track_face'?" in outcome.err


def test_show_draws_every_node(mission: Mission) -> None:
    for form in ("unicode", "ascii", "dot"):
        drawn = mission("show", "greet", "--format", form).out
        assert all(word in drawn for word in ("find_face", "track_face", "greet the person", "gesture", "say"))


def test_see_finds_exactly_the_one_face_of_the_astronaut(mission: Mission) -> None:
    cv2.imwrite("astronaut.png", cv2.cvtColor(skimage.data.astronaut(), cv2.COLOR_RGB2BGR))
    outcome = mission("see", "astronaut.png", "--json", "--annotate", "drawn")
    (seen,) = events_of(outcome.out.splitlines())
    assert (seen["file"], seen["frame"]) == ("astronaut.png", 0)
    ((x, y, width, height),) = seen["faces"]
    assert x < 225 < x + width
    assert y < 110 < y + height
    drawn, plain = cv2.imread("drawn/astronaut.png"), cv2.imread("astronaut.png")
    assert drawn is not None
    assert plain is not None
    assert drawn.shape == plain.shape
    assert (drawn != plain).any()


def test_see_refuses_missing_and_undecodable_files(mission: Mission) -> None:
    Path("note.txt").write_text("hello")
    Path("broken.jpg").write_bytes(b"no picture")
    for name, words in (("absent.png", "no such file"), ("broken.jpg", "cannot be decoded")):
        outcome = mission("see", name)
        assert outcome.code == 2
        assert words in outcome.err
        assert "Traceback" not in outcome.err


def test_dynamixel_sdk_can_use_the_virtual_servos(tmp_path: Path) -> None:
    process = Process("simulate", "--state", "0.1", folder=tmp_path)
    ports = json.loads(process.wait_for_line(lambda line: line.startswith("{")))["ports"]
    assert ports.keys() == {"base", "head", "arm"}
    port, packets = PortHandler(ports["arm"]), PacketHandler(1.0)
    port.openPort()
    port.setBaudRate(1_000_000)
    # That program waits for an answer for 34 ms, and for no longer, however busy the machine is.
    wait_until(lambda: packets.ping(port, 4) == (12, COMM_SUCCESS, 0))
    wait_until(lambda: packets.write2ByteTxRx(port, 4, 30, 600) == (COMM_SUCCESS, 0))
    port.closePort()
    process.wait_for_line(lambda line: '"shoulder_lift": 0.4' in line)
    assert process.end(signal.SIGTERM) == 0


def test_foreign_module_that_shadows_ours_is_named(tmp_path: Path) -> None:
    (tmp_path / "config.py").write_text("# somebody else's\n")
    done = subprocess.run(
        [sys.executable, "-m", "missions", "list"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert f"config: found {tmp_path / 'config.py'}" in done.stderr
    assert "try: " in done.stderr
    assert "Traceback" not in done.stderr


def test_udev_rules_are_printed_with_the_install_command(mission: Mission) -> None:
    outcome = mission("robot", "udev")
    assert outcome.code == 0
    assert all(word in outcome.out for word in ('SYMLINK+="kobuki"', 'SYMLINK+="rplidar"', "latency_timer"))
    assert "sudo" not in outcome.out, "it can be written where udev reads it"
    assert "mission robot udev | sudo tee /etc/udev/rules.d/99-missiontree.rules" in outcome.err


def test_demo_installs_only_runtime_dependencies() -> None:
    root = Path(__file__).parents[2]
    done = subprocess.run(["make", "-C", str(root), "-pn"], capture_output=True, text=True, check=False).stdout
    named = set(next(line for line in done.splitlines() if line.startswith("DEMO := ")).split()[2:])
    needed, left = set[str](), ["missiontree", "hatchling", "editables"]
    while left:
        name = canonicalize_name(left.pop())
        if name not in needed:
            needed.add(name)
            wanted = [Requirement(text) for text in requires(name) or ()]
            left += [each.name for each in wanted if each.marker is None or each.marker.evaluate({"extra": ""})]
    assert named - {"colorama"} == needed - {"missiontree"}  # which Windows alone has
    pinned = {line.partition("==")[0] for line in (root / "constraints.txt").read_text().splitlines()}
    assert named <= pinned


def test_list_gestures_shows_their_robots(mission: Mission) -> None:
    lines = {line.split()[0]: line for line in mission("list", "gestures").out.splitlines()[1:]}
    assert lines["wave"].endswith("(humanoid)")
    assert lines["greeting"].endswith("(turtlebot2_arm)")


def test_list_gestures_shows_own_robots_with_the_arm(mission: Mission) -> None:
    folder = config_folder() / "robots"
    folder.mkdir(parents=True)
    arm = find_file("robots", "so101").read_text().partition("\narm:\n")[2].partition("\nvoice:")[0]
    right = arm.replace("/dev/ttyACM0", "/dev/ttyACM1")
    (folder / "pair.yaml").write_text(f"robot: pair\nright_arm:\n  kind: arm\n{right}")
    (folder / "wrong.yaml").write_text("robt: wrong\n")
    lines = {line.split()[0]: line for line in mission("list", "gestures").out.splitlines()[1:]}
    assert lines["arm_wave"].endswith("(koch, so101, so101_leader, pair on: right_arm)")


def test_last_output_line_names_the_written_files(mission: Mission) -> None:
    write("hello.yaml", "  wait: 0.1 s\n")
    Path("hello.test.yaml").write_text("tests: hello.yaml\ncases:\n  - case: it ends\n    expect: {result: success}\n")
    record = ("--record", "r.mcap", "--events", "e.jsonl")
    for arguments, files in (
        (("run", "hello.yaml", "--simulate", "fast", *record), ["r.mcap", "e.jsonl"]),
        (("test", "hello.test.yaml", "--junit", "j.xml"), ["j.xml"]),
        (("show", "hello.yaml", "-o", "h.svg"), ["h.svg"]),
        (("schema", "-o", "s.json"), ["s.json"]),
        (("show", "empty", "-o", "w.svg"), ["w.svg"]),
        (("record", "cut", "r.mcap", "0s", "1s", "-o", "c.mcap"), ["c.mcap"]),
        (("record", "export", "r.mcap", "--jsonl", "l.jsonl"), ["l.jsonl"]),
        (("record", "report", "r.mcap", "-o", "r.html"), ["r.html"]),
        (("servo", "play", "greeting", "--dry-run", "--plot", "p.png"), ["p.png"]),
    ):
        outcome = mission(*arguments)
        last = [text.splitlines()[-1] for text in (outcome.out, outcome.err) if text]
        assert any(all(file in line for file in files) for line in last), (arguments, outcome)
        assert all(Path(file).exists() for file in files)


RUBBISH = '''
import gc

from behaviours.leaf import FAILURE, SUCCESS, Leaf


class Rubbish(Leaf):
    """Fails where what the run was built of is searched for rubbish."""
    tag = "rubbish"

    def update(self):
        return SUCCESS if gc.isenabled() and gc.get_freeze_count() > 10 * len(gc.get_objects()) else FAILURE
'''


def test_garbage_collector_skips_objects_built_before_the_ticks(tmp_path: Path) -> None:
    (tmp_path / "leaves.py").write_text(RUBBISH)
    (tmp_path / "m.yaml").write_text("mission: m\ntree: rubbish\n")
    words = [sys.executable, "-m", "missions", "run", "m.yaml", "--behaviours", "leaves.py", "--simulate", "fast"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
