"""Mistakes of new users: words of other languages, slips of the keyboard and of pasted text, and what is answered."""

import json
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest

from behaviours.catalogue import LEAVES
from config.diagnostics import KEY_SYNONYMS as FILE_KEYS
from config.diagnostics import Diagnostic, InvalidFileError, SourceText, key_of
from drivers.api.kinds import ACTUATOR_KINDS
from missions.language.document import check_plan
from missions.language.mission_body import MISSION_KEYS
from missions.language.nodes import BRANCHES, MODIFIERS
from missions.language.steps import BESIDE_KEYS
from missions.language.synonyms import SYNONYMS, unknown_word_hint
from missions.library.drivers import DriverTable, parse_robot
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission, shipped_missions
from missions.plugins.schema.robots import part_schemas

BASE = "robot: r\nbase: {driver: kobuki, port: /dev/kobuki, "
JOINT = "robot: r\narm:\n  driver: dynamixel\n  port: /dev/u2d2\n  joints:\n    elbow: {id: 1, limits: [0 deg, 9 deg], "


class Mistake(NamedTuple):
    """What somebody has written: its lines in a sequence, or a whole file; each line of the answer."""

    written: str
    answer: tuple[str, ...]


def a(written: str, *answer: str) -> Mistake:
    return Mistake(written, answer)


MISTAKES = [
    # Words of other languages
    a("- sleep: 2 s", "unknown behaviour 'sleep' > write 'wait'"),
    a("- rotate: 90 deg", "unknown behaviour 'rotate' > write 'turn: 90 deg'"),
    a("- loop: [stop]", "unknown behaviour 'loop' > write 'repeat', beside a behaviour"),
    a("- stop:\n  loop: 3", "unknown modifier 'loop' > write 'repeat', beside a behaviour"),
    a("- fallback: [stop]", "unknown behaviour 'fallback' > write 'selector'"),
    a("- priority: [stop]", "unknown behaviour 'priority' > write 'selector'"),
    a(
        "- if: face.seen\n  then: [stop]",
        "unknown behaviour 'then' > write switch: {on: CONDITION, cases: {true: ..., false: ...}}",
    ),
    a("- stop:\n  if: face.seen\n  else: [stop]", "unknown modifier 'else' > write switch: "),
    a("- case: {on: face.count, cases: {1: stop}}", "unknown behaviour 'case' > write switch: "),
    a("- and: [stop, face_seen]", "unknown behaviour 'and' > write 'sequence'"),
    a("- or: [face_seen, stop]", "unknown behaviour 'or' > write 'selector'"),
    a("- foreach: [stop]", "unknown behaviour 'foreach' > write {for_each: {in: LIST, as: NAME, do: BEHAVIOUR}}"),
    a("- print: Hello", "unknown behaviour 'print' > write 'say' or 'log'"),
    a("- call: greet", "unknown behaviour 'call' > write 'mission'"),
    a("- run: greet", "unknown behaviour 'run' > write 'mission'"),
    a("- goto: {x: 1 m, y: 0 m}", "unknown behaviour 'goto' > write 'go_to'"),
    a("- speak: Hello", "unknown behaviour 'speak' > write 'say'"),
    a("- ReactiveFallback: [stop]", "unknown behaviour 'ReactiveFallback' > write 'reactive_selector'"),
    a("- Sequence: [stop]", "unknown behaviour 'Sequence' > did you mean 'sequence'?"),
    a("- track-face", "unknown behaviour 'track-face' > did you mean 'track_face'?"),
    a(
        "- stop:\n  retries: 3",
        "unknown modifier 'retries' > write 'retry: N' beside a behaviour, where N is the number of retries plus 1",
    ),
    a("- stop:\n  when: face.seen", "unknown modifier 'when' > write 'if', beside a behaviour"),
    a("- greet", "unknown behaviour 'greet' > it is a mission: write 'mission: greet'"),
    a(
        "- find_person: {patience: 5 s}",
        "unknown behaviour 'find_person' > it is a mission: write 'mission: find_person', and its params under 'with:' "
        "beside it",
    ),
    a("- forward: 1 m", "unknown behaviour 'forward' > write 'drive: 1 m'"),
    a("- turn_right: 90 deg", "unknown behaviour 'turn_right' > write 'turn: -90 deg'"),
    a("- if: face.seen\n- Timeout: 5 s", "no behaviour here", "unknown behaviour 'Timeout' > did you mean 'timeout'?"),
    a("- retry", "unknown behaviour 'retry' > 'retry' stands beside a behaviour, below it and without a dash"),
    # True and false
    a(
        "- switch: {on: face.seen, cases: {yes: stop, no: {say: Bye}}}",
        "'on' is true or false and never equals 'yes' > write true: for yes:",
        "'on' is true or false and never equals 'no' > write false: for no:",
    ),
    a(
        "- switch: {on: battery.percent > 20, cases: {full: stop}}",
        "'on' is true or false and never equals 'full' > the cases can be true: and false:",
    ),
    a(
        "- set: {known: true}\n- switch: {on: known, cases: {yes: stop}}",
        "'on' is true or false and never equals 'yes' > write true: for yes:",
    ),
    a(
        "- switch: {on: face.count, cases: {0: stop, none: stop, true: stop, many: stop}}",
        "'on' is a number and never equals 'true'",
        "'on' is a number and never equals 'many'",
    ),
    a(
        "- switch: {on: base.x, cases: {1 m: stop, 20 cm: stop, 3: stop, 3 s: stop}}",
        "'on' is a length and never equals '3'",
        "'on' is a length and never equals '3 s'",
    ),
    a("- set: {word: '3'}\n- switch: {on: word, cases: {3: stop, yes: {say: Hi}}}", ""),
    a("- set: {seen: null}\n- set: {seen: true}\n- switch: {on: seen, cases: {null: stop, true: {say: Hi}}}", ""),
    a(
        "- switch: face.seen",
        "'switch' needs 'on' and 'cases' > write switch: {on: face.count, cases: {1: ..., 2: ...}",
    ),
    a("- switch: {on: face.seen, cases: {true: stop, false: {say: Bye}}}", ""),
    # Where a modifier stands
    a(
        "- drive:\n    distance: 1 m\n    timeout: 5 s",
        "'drive' has no argument 'timeout' > outdent it, to stand beside 'drive'",
    ),
    a(
        "- switch:\n    on: face.count\n    cases: {1: stop}\n    retry: 2",
        "'switch' has no key 'retry' > outdent it, to stand beside 'switch'",
    ),
    a(
        "- say: Hi\n    timeout: 5 s",
        "'timeout' is indented further than 'say', which has its value already > outdent it, to stand below 'say'",
    ),
    a(
        "- selector:\n    - fail\n    timeout: 5 s",
        "'timeout' stands under the dash > indent it by two more spaces, under 'fail', or outdent it, to stand below "
        "'selector'",
    ),
    # Shares, and what was pasted
    a(
        "- stop:\n  if: battery.percent < 20%",
        "'if': cannot compare a percent and a share > a percent value is a number from 0 to 100: write 20 for 20 %",
    ),
    a("- say:\u00a0Hello", "a non-breaking space (U+00A0), which YAML treats as a letter > write a normal space"),
    a("-\u00a0say: Hello", "a non-breaking space (U+00A0), which YAML treats as a letter > write a normal space"),
    a(
        "- go_to: {x:\u00a01 m, y: 0 m}",
        "'go_to' has no argument 'x:\u00a01 m' > it contains an unusual space",
    ),
    a(
        "- wait: \u201c2 s\u201d",
        "'wait' needs a duration such as '2 s', got '\u201c2 s\u201d' > \u201c is not a quote here",
    ),
    a(
        "- stop:\n  if: face.name == \u201cAnna\u201d",
        "'if': 'face.name == \u201cAnna\u201d' is not an expression > \u201c is",
    ),
    a("- say: {text: \u201cHi, Anna\u201d}", "'say' has no argument 'Anna\u201d' > \u201d is not a quote here: write"),
    a("- say: 'Bonjour\u00a0: \u201cAnna\u201d'", ""),
    a("- say: \u201cHi: you\u201d", "a second ': ' in one value > put quotes (\" or ', no others) around a text"),
    # Conditions
    a("- stop:\n  if: face.seen == yes", "'if': unknown name 'yes' > write 'true'"),
    a(
        "- stop:\n  if: battery < 20",
        "'if': unknown name 'battery' > add a member; known are: battery.percent, battery.",
    ),
    a(
        "- stop:\n  if: face.name == 3",
        "'if': cannot compare a text and a number > a text stands in quotes",
    ),
    a("- drive: {distance: 1 m, velocity: 1 m/s}", "'drive' has no argument 'velocity' > write 'speed'"),
    # A mistake of YAML, and those behind it
    a(
        "- stop:\n  timeout 5 s\n- trak_face\n- drive: 1",
        "'timeout' lacks a colon > write 'timeout: 5 s'",
        "unknown behaviour 'trak_face' > did you mean 'track_face'?",
        "'drive' needs a length such as '0.5 m': '1' has no unit",
    ),
    a(
        "- stop\n  timeout: 5 s\n- sleep: 1 s",
        "'stop' has something beside it, so it needs a colon > write '- stop:'",
        "unknown behaviour 'sleep' > write 'wait'",
    ),
    a(
        '- say: "Hello\n- sleep: 1 s\n- say: {text: ${n}}',
        "unclosed quote",
        "unknown behaviour 'sleep' > write 'wait'",
    ),
    a(
        "robot: r\nbase:\n  driver kobuki\n  port: /dev/kobuki\n  max_speed: 3\n",
        "'driver' lacks a colon > write 'driver: kobuki'",
        "'max_speed' needs a speed such as '0.2 m/s': '3' has no unit",
    ),
    # Whole files
    a("mission: m\nsteps: [stop]\n", "a mission has no key 'steps' > write 'tree'"),
    a("name: m\ndescription: x\ntree: stop\n", "a mission has no key 'name' > write 'mission'"),
    a(BASE + "baudrate: 9600}\n", "'base' has no key 'baudrate' > write 'baud'"),
    a(BASE + "max_velocity: 0.3 m/s}\n", "'base' has no key 'max_velocity' > write 'max_speed'"),
    a("robot: r\nbase: {type: kobuki, device: /dev/kobuki}\n", "'base' has no key 'type' > write 'driver'"),
    a("robot: r\ncamera: {fov: 60 deg, device: 0}\n", "'camera' has no key 'fov' > write 'field_of_view'"),
    a(JOINT + "velocity: 9 deg/s}\n", "joint 'elbow' has no key 'velocity' > write 'speed'"),
    a("name: r\nmic: {}\n", "a robot file has no key 'name' > write 'robot'"),
]


def answer(written: str) -> list[Diagnostic]:
    """What the checker says to it."""
    text = written
    if written.startswith("- "):
        text = "mission: m\ntree:\n  sequence:\n" + "".join(f"    {line}\n" for line in written.splitlines())
    try:
        if text.startswith("robot") or "mic: " in text:
            parse_robot(SourceText("r.yaml", text))
        else:
            check_plan(SourceText("m.yaml", text), LEAVES, LOOKUPS, find_mission=find_mission)
    except InvalidFileError as error:
        return list(error.diagnostics)
    return []


def test_mistakes_of_new_users_give_suggestions() -> None:
    wrong = []
    for written, expected in MISTAKES:
        said = [f"{fault.message} > {fault.suggestion}" for fault in answer(written)]
        missing = [line for line in expected if line and not any(each.startswith(line) for each in said)]
        if missing or bool(said) != any(expected):
            wrong.append(f"{written!r}\n  was answered with {said}\n  and not with {missing}")
    assert not wrong, "\n".join(wrong)


BROUGHT = {
    "drive: 1 m": "forward move move_forward go_forward drive_distance DriveOnHeading move_steps",
    "drive: -1 m": "back backward BackUp reverse",
    "turn: 90 deg": "spin Spin turn_left rotate_left turn_anticlockwise rotate turn_degrees",
    "turn: -90 deg": "turn_right rotate_right turn_clockwise",
    "turn: 180 deg": "turn_around",
    "go_to": "goto goto_pose drive_to",
    "navigate": "MoveBase move_base NavigateToPose",
    "ros2_action": "action_client",
    "set: {NAME: VALUE}": "blackboard SetBlackboard SetBlackboardVariable Script assign",
    "wait: TIME": "Delay",
    "velocity": "cmd_vel twist set_speed",
    "stop": "halt brake freeze stop_robot",
    "look": "move_head turn_head set_head",
    "look: 30 deg": "look_left",
    "look: -30 deg": "look_right",
    "move_joints": "move_joint set_joint move_servo move_arm",
    "track_face": "follow_face track_person",
    "follow_person": "follow",
    "wait": "sleep timer wait_seconds idle",
    "listen": "hear listen_for recognize_speech",
    "sound": "beep",
    "led": "light set_led",
    "face": "set_face emotion smile",
    "face_seen": "see_face is_face_visible face_detected detect_face person_seen",
    "object_seen": "object_detected see_object",
    "pretend": "StatusQueue",
    "sequence": "AsyncSequence MemSequence and",
    "reactive_switch": "WhileDoElse",
    "if', beside a behaviour": "when only_if",
    "while', beside a behaviour": "EternalGuard guard",
    "once: true', beside a behaviour": "OneShot oneshot",
    "retry: forever', beside a behaviour": "RepeatUntilSuccess FailureIsRunning",
    "on_running: fail', beside a behaviour": "RunningIsFailure",
    "repeat: forever', beside a behaviour": "KeepRunningUntilFailure loop_forever",
}
"""Words of BehaviorTree.CPP, py_trees, Nav2, ROS, Scratch and of plain English, by what is to be written for them."""

NOTHING_LIKE_IT = "cancel ConsumeQueue pan_tilt servo subscribe TickCounter glide home exit dance grip"
"""Words for which nothing is proposed: what is here means something else, however it is spelt."""


def test_foreign_word_suggests_ours_with_its_argument() -> None:
    given = {
        word: ours.removesuffix("', beside a behaviour") for ours, words in BROUGHT.items() for word in words.split()
    }
    assert len(given) > 80
    assert {word: meant(word).split("'")[1] for word in given if "'" in meant(word)} == given
    told = {word: answer(f"- {word}: 1\n")[0].suggestion for word in given}
    assert [word for word, ours in given.items() if f"'{ours}'" not in told[word]] == []
    assert [word for word in NOTHING_LIKE_IT.split() if meant(word)] == []


def test_only_motion_words_suggest_a_motion() -> None:
    motions = (
        "rotat turn spin forward back move driv go nav cmd_vel twist velocity speed reverse head look joint servo arm"
    )
    motions += " follow track nod dock stop halt brake freeze search look"
    moving = {word for word, leaf in LEAVES.items() if leaf.drives.intersection(ACTUATOR_KINDS)}
    leading = [word for ours, words in SYNONYMS.items() if key_of(ours) in moving for word in words.split()]
    assert len(leading) > 50
    assert [word for word in leading if not any(each in word for each in motions.split())] == []


def test_own_mission_takes_precedence_over_a_synonym(tmp_path: Path) -> None:
    (tmp_path / "forward.yaml").write_text("mission: forward\ntree: stop\n", encoding="utf-8")
    with pytest.raises(InvalidFileError) as told:
        check_plan(
            SourceText(str(tmp_path / "m.yaml"), "mission: m\ntree: forward\n"),
            LEAVES,
            LOOKUPS,
            find_mission=find_mission,
        )
    assert told.value.diagnostics[0].suggestion.startswith("it is a mission: write 'mission: forward")


def test_foreign_word_is_reported_once() -> None:
    assert len(answer("mission: m\nsteps: [stop]\n")) == 1
    assert len(answer("robot: r\nbase: {type: kobuki, device: /dev/kobuki}\n")) == 2


def meant(word: str) -> str:
    return unknown_word_hint(word, LEAVES, BRANCHES, (*MODIFIERS, *BESIDE_KEYS), alone=False)


def test_similar_spelling_never_suggests_a_motion() -> None:
    moving = [word for word, leaf in LEAVES.items() if leaf.drives.intersection(ACTUATOR_KINDS)]
    strange = (
        "sleep steep sweet loop lock book cook hook took burn torn tune tan clay pray slay "
        "drove dark duck deck knock nodding canned skin error scam scar spoon gestures_off mirage tour plan "
        "rover wonder wounded shake head center_on seek hunt chase approach dance spring swim hop jump "
        "up down left right step wave hello blink smile react alarm "
        "light "
    )
    answers = {word: meant(word) for word in strange.split()}
    assert not [(word, told) for word, told in answers.items() for moves in moving if f"'{moves}'" in told]


def test_ambiguous_typing_mistake_does_not_suggest_a_motion() -> None:
    slips = "lay pay it st wsit arce darc ar lok san seep alk"  # say, if, set, wait, race, dark, as, log, sleep, talk
    moving = [word for word, leaf in LEAVES.items() if leaf.drives.intersection(ACTUATOR_KINDS)]
    answers = {slip: meant(slip) for slip in slips.split()}
    assert not [(slip, told) for slip, told in answers.items() for word in moving if f"'{word}'" in told]


def test_clear_typing_mistake_suggests_a_motion() -> None:
    slips = {
        "tunr": "turn",
        "trun": "turn",
        "drve": "drive",
        "sweeep": "sweep",
        "trak_face": "track_face",
        "track_fave": "track_face",
    }
    assert {slip: meant(slip) for slip in slips} == {slip: f"did you mean '{word}'?" for slip, word in slips.items()}


def test_every_synonym_stands_for_an_existing_word() -> None:
    ours = {*LEAVES, *BRANCHES, *MODIFIERS, *BESIDE_KEYS, *MISSION_KEYS}
    assert not {key_of(word) for word in SYNONYMS} - ours
    read = "\n".join(path.read_text(encoding="utf-8") for path in Path("config").glob("*.py"))
    read += "\n".join(path.read_text(encoding="utf-8") for path in Path("missions/plugins/testing").glob("*.py"))
    read += json.dumps(part_schemas(DriverTable()))
    assert not [word for word in FILE_KEYS if f'"{key_of(word)}"' not in read]
    assert not {word for theirs in SYNONYMS.values() for word in theirs.split()} & {*LEAVES, *BRANCHES, *MODIFIERS}


SLIPS: dict[str, Callable[[str], str]] = {
    "a tab": lambda line: f"\t{line.lstrip()}",
    "a quote that is not closed": lambda line: line.replace(": ", ': "', 1),
    "indented too far": lambda line: f"   {line}",
    "not indented enough": lambda line: line.removeprefix(" "),
    "a bracket that is not closed": lambda line: line.rstrip("]}"),
}


def test_yaml_syntax_mistake_is_reported_once() -> None:
    random, wrong = Random(7), []  # noqa: S311 - which slips are tried
    files = [path.read_text(encoding="utf-8") for path in shipped_missions().values()]
    for what, slip in SLIPS.items():
        for _ in range(30):
            lines = random.choice(files).splitlines()
            place = random.choice([at for at, line in enumerate(lines) if line.strip() and line.lstrip()[0] != "#"])
            lines[place] = slip(lines[place])
            faults = answer("\n".join(lines) + "\n")
            if len(faults) > 1 and any(fault.repaired_lines for fault in faults):
                wrong.append(f"{what}, {lines[place]!r}: {[f'{fault.mark.line}: {fault.message}' for fault in faults]}")
    assert not wrong, "\n".join(wrong)
