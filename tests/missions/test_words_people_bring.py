"""Mistakes of new users: words of other languages, slips of the keyboard and of pasted text, and what is answered."""

from pathlib import Path
from typing import NamedTuple, get_type_hints

from behaviours.catalogue import LEAVES
from config.faults import Fault, InvalidFileError, Source
from config.robot import robot_of
from config.synonyms import KEYS as FILE_KEYS
from config.synonyms import head_of
from missions.assembly.things import THINGS
from missions.executive.state import state_of
from missions.language.body import KEYS
from missions.language.document import check_plan
from missions.language.flags import FLAGS
from missions.language.modifiers import MODIFIERS
from missions.language.plan import COMPOSITES, MISSION, SWITCHES
from missions.language.steps import BESIDE
from missions.language.synonyms import MOVING, WORDS, word_meant
from missions.library import find_mission
from missions.testing.recorders import Bench

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
    a("- rotate: 90 deg", "unknown behaviour 'rotate' > write 'turn'"),
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
    a("- print: Hello", "unknown behaviour 'print' > write 'say' or 'log'"),
    a("- call: greet", "unknown behaviour 'call' > write 'mission'"),
    a("- run: greet", "unknown behaviour 'run' > write 'mission'"),
    a("- goto: {x: 1 m, y: 0 m}", "unknown behaviour 'goto' > write 'go_to'"),
    a("- speak: Hello", "unknown behaviour 'speak' > write 'say'"),
    a("- ReactiveFallback: [stop]", "unknown behaviour 'ReactiveFallback' > write 'reactive_selector'"),
    a("- Sequence: [stop]", "unknown behaviour 'Sequence' > did you mean 'sequence'?"),
    a("- track-face", "unknown behaviour 'track-face' > did you mean 'track_face'?"),
    a("- stop:\n  retries: 3", "unknown modifier 'retries' > write 'retry', beside a behaviour"),
    a("- stop:\n  when: face.seen", "unknown modifier 'when' > write 'if', beside a behaviour"),
    a("- greet", "unknown behaviour 'greet' > it is a mission: write 'mission: greet'"),
    a(
        "- find_person: {patience: 5 s}",
        "unknown behaviour 'find_person' > it is a mission: write 'mission: find_person', and its params under 'with:' "
        "beside it",
    ),
    # True and false
    a(
        "- switch: {on: face.seen, cases: {yes: stop, no: {say: Bye}}}",
        "'on' is true or false, and never 'yes' > write true: for yes:",
        "'on' is true or false, and never 'no' > write false: for no:",
    ),
    a(
        "- switch: {on: battery.percent > 20, cases: {full: stop}}",
        "'on' is true or false, and never 'full' > the cases can be true: and false:",
    ),
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


def answer(written: str) -> list[Fault]:
    """What the checker says to it."""
    text = written
    if written.startswith("- "):
        text = "mission: m\ntree:\n  sequence:\n" + "".join(f"    {line}\n" for line in written.splitlines())
    try:
        if text.startswith("robot") or "mic: " in text:
            robot_of(Source("r.yaml", text))
        else:
            check_plan(Source("m.yaml", text), LEAVES, THINGS, find_mission=find_mission)
    except InvalidFileError as error:
        return list(error.faults)
    return []


def test_mistakes_of_new_users_are_answered_with_what_to_write() -> None:
    wrong = []
    for written, expected in MISTAKES:
        said = [f"{fault.message} > {fault.suggestion}" for fault in answer(written)]
        missing = [line for line in expected if line and not any(each.startswith(line) for each in said)]
        if missing or bool(said) != any(expected):
            wrong.append(f"{written!r}\n  was answered with {said}\n  and not with {missing}")
    assert not wrong, "\n".join(wrong)


def test_a_word_of_another_language_is_one_mistake_and_not_two() -> None:
    assert len(answer("mission: m\nsteps: [stop]\n")) == 1
    assert len(answer("robot: r\nbase: {type: kobuki, device: /dev/kobuki}\n")) == 2


def meant(word: str) -> str:
    return word_meant(word, LEAVES, (*COMPOSITES, *SWITCHES, MISSION), (*MODIFIERS, *BESIDE), alone=False)


def test_a_likeness_of_spelling_alone_never_leads_to_what_moves() -> None:
    moving = [word for word, leaf in LEAVES.items() if leaf.drives & MOVING]
    strange = (
        "sleep steep sweet loop lock book cook hook took burn torn tune tan clay pray slay "
        "drove dark duck deck knock nodding canned skin error scam scar spoon gestures_off mirage tour plan "
        "rover wonder wounded shake head center_on seek hunt chase approach dance spring swim hop jump sit "
        "stand up down left right forward backward move step walk wave hello blink smile react alarm "
        "light "
    )
    assert not [(word, meant(word)) for word in strange.split() for moves in moving if f"'{moves}'" in meant(word)]


def test_a_slip_of_the_keyboard_still_leads_there() -> None:
    slips = {"tunr": "turn", "drve": "drive", "sweeep": "sweep", "trak_face": "track_face", "track_fave": "track_face"}
    assert {slip: meant(slip) for slip in slips} == {slip: f"did you mean '{word}'?" for slip, word in slips.items()}


def test_what_a_synonym_stands_for_is_a_word_of_ours() -> None:
    ours = {*LEAVES, *COMPOSITES, *SWITCHES, MISSION, *MODIFIERS, *BESIDE, *KEYS}
    assert not {head_of(word) for word in WORDS} - ours
    read = "\n".join(path.read_text(encoding="utf-8") for path in Path("config").glob("*.py"))
    read += "\n".join(path.read_text(encoding="utf-8") for path in Path("missions/testing").glob("*.py"))
    assert not [word for word in FILE_KEYS if f'"{head_of(word)}"' not in read]
    assert not {word for theirs in WORDS.values() for word in theirs.split()} & {*LEAVES, *COMPOSITES, *MODIFIERS}


def test_the_state_that_is_true_or_false_is_known() -> None:
    bench = Bench()
    truly = {
        f"{name}.{member}"
        for name, part in state_of(bench.robot, bench.clock).items()
        for member, kept in vars(type(part)).items()
        if isinstance(kept, property) and "bool" in str(get_type_hints(kept.fget)["return"])
    }
    assert truly == FLAGS
