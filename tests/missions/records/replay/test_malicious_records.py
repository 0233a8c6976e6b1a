"""Records of somebody who means harm: nothing of them is run, nothing waits for them, and what is wrong is told."""

import json
import os
import signal
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from missions.executive.events import Ended, FaultRaised, Logged, NodeChanged, VariableSet
from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording.items import PictureItem, ViewItem, pack_items, unpack_items
from missions.plugins.records.recording.record_header import RecordContents, RecordHeader
from missions.plugins.records.recording.tagged_values import to_json as to_fields_of
from missions.plugins.records.recording.writer import ChunkSink, RecordMessage, RecordWriter
from missions.trees.drawing import to_json
from perception.api import Box, View
from tests.missions.command import command
from tests.missions.records.recording.small_record import HEAD, TREE, Item, face, items, moments
from tests.missions.records.report.told_record import picture as small_picture

COMMAND_TIMEOUT = 20.0
"""Seconds that one command may take with one record: none takes a tenth of that."""

MISSION = b"mission: greet\ntree: {sequence: [{wait: 1 s}]}\n"
ROBOT = (Path(__file__).parents[4] / "config/robots/turtlebot2.yaml").read_bytes()
FILES: Mapping[str, bytes] = {"mission/greet.yaml": MISSION, "robot/turtlebot2.yaml": ROBOT}

ESCAPES = "\x1b]0;owned\x07\x1b[2J\x9b31m\x85\u202etxt\u2066\x7f\r\nmission: success"
"""What a terminal would obey: its title, its screen, its colours, the order of letters, lines that seem to be ours."""

PATHS = ("/dev/zero", "/dev/full", "/dev/tty", "/proc/self/mem", "/proc/kmsg", "/", "FIFO", "/dev/stdin", "/etc/shadow",
         "x" * 5000, "nul\0", "~/.ssh/id_rsa", "../../../../../../dev/zero")  # fmt: skip
"""Where a record says that its files were."""

NAMES = ("../../evil", "/evil", "mission/../../../evil", "..", "/", "", ".", "a" * 300, "nul\0.py", "\x1b[2Jevil",
         "mission/greet.yaml/below", "tree.json/below", "//evil", "C:\\evil")  # fmt: skip
"""How attached files are called."""


def evil(folder: Path) -> str:
    """Return Python that leaves a mark when it is run."""
    return f"open({str(folder / 'RUN')!r}, 'w').close()\n"


def few(found: Sequence[Item]) -> list[Item]:
    """Return what happened with a tenth of its moments: hundreds of commands read it, and all are alike."""
    return [item for item in found if not isinstance(item, TickRecord) or item.tick % 10 == 0]


def write(
    path: Path,
    *,
    head: RecordHeader = HEAD,
    files: Mapping[str, bytes] = FILES,
    tree: bytes | None = None,
    what: Sequence[Item] | None = None,
    raw: Sequence[RecordMessage] = (),
) -> Path:
    """Write a record as a run would, with ``raw`` messages at its end; return its path."""
    contents = RecordContents(head, files, json.dumps(to_json(TREE)).encode() if tree is None else tree)
    with path.open("wb", buffering=0) as file:
        writer = RecordWriter(ChunkSink(file.fileno()), contents)
        writer.begin()
        for item in unpack_items(pack_items(few(items() if what is None else what))):
            writer.add(item)
        for message in raw:
            writer._write_message(message)
        writer.flush()
        assert writer.close().whole
    return path


def hostile_items() -> list[Item]:
    """Return what happened, with escapes in every text."""
    return [
        NodeChanged(0.05, 1, "1", ESCAPES, ESCAPES, 3, "running", ""),
        NodeChanged(0.1, 1, "1.1", ESCAPES, ESCAPES, 3, "failure", ESCAPES),
        VariableSet(0.1, 1, ESCAPES, ESCAPES, ESCAPES),
        FaultRaised(0.1, ESCAPES, ESCAPES, ESCAPES, ESCAPES),
        Logged(0.2, ESCAPES, ESCAPES),
        *moments(),
        Ended(4.0, ESCAPES, "failure", ESCAPES, 4.0, 80),
    ]


def picture(width: int, height: int) -> bytes:
    """Return a JPEG whose header says that it is so large."""
    found = bytearray(small_picture(9))
    at = found.index(b"\xff\xc0") + 5
    found[at : at + 4] = height.to_bytes(2) + width.to_bytes(2)
    return bytes(found)


def to_fields(value: object) -> dict[str, Any]:
    """Return a value as a record has it, also with numbers that no run has."""
    found = to_fields_of(value)
    assert isinstance(found, dict)
    return found


def raw(topic: str, data: object) -> RecordMessage:
    return RecordMessage(topic, 1.0, data if isinstance(data, bytes) else json.dumps(data).encode())


def made(folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield what each record is about, and how it is written."""
    yield from of_code(folder)
    yield from of_files(folder)
    yield from of_texts()
    yield from of_numbers()


def of_code(folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    code = {"behaviours/mine.py": evil(folder).encode()}
    named = replace(HEAD, behaviours=("behaviours/mine.py",))
    script = folder / "here.py"
    script.write_text(evil(folder))
    yield "code of its own", {"head": named, "files": {**FILES, **code}}
    yield "code of this machine", {"head": replace(named, paths={"behaviours/mine.py": str(script)})}
    yield (
        "code behind another name",
        {
            "head": replace(named, paths={"behaviours/mine.py": str(script)}),
            "files": {**FILES, **code, "behaviours/../mine.py": b""},
        },
    )
    yield "code as a mission", {"head": replace(HEAD, behaviours=("mission/greet.yaml",))}
    yield "code outside", {"head": replace(HEAD, behaviours=(str(script), "../../here.py"))}
    yield "code as the robot", {"head": replace(HEAD, robot=str(script)), "files": {"mission/greet.yaml": MISSION}}


def of_files(folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    for n, path in enumerate(PATHS):
        place = str(folder / path) if path == "FIFO" else path
        yield f"all files of {place:.20}", {"head": replace(HEAD, paths=dict.fromkeys(FILES, place))}
        if n < 8:
            yield (
                f"robot {place:.20}",
                {
                    "head": replace(HEAD, robot=place, file=place),
                    "files": {"mission/greet.yaml": MISSION},
                },
            )
    for name in NAMES:
        yield f"a file called {name:.20}", {"files": {**FILES, name: b"evil"}}
    inner = "mission: greet\ntree: {{sequence: [{}]}}\n"
    for what in ("mission: FIFO", "gesture: FIFO", "play: FIFO", "mission: /dev/zero", "play_sound: /dev/zero"):
        text = inner.format("{" + what.replace("FIFO", str(folder / "FIFO")) + "}")
        yield what, {"files": {**FILES, "mission/greet.yaml": text.encode()}}
    model = ROBOT + f"\n  detector: yunet\n  model: {folder / 'FIFO'}\n".encode()
    yield "a model that is a pipe", {"files": {**FILES, "robot/turtlebot2.yaml": model}}
    for width, height in ((65500, 65500), (65500, 1), (20000, 20000)):
        shown = [ViewItem(second + 0.01, View(float(second), (face(float(second)),))) for second in range(4)]
        pictures = [PictureItem(float(second), picture(width, height), None) for second in range(4)]
        yield f"pictures of {width} x {height}", {"what": [*moments(), *shown, *pictures]}


def of_texts() -> Iterator[tuple[str, dict[str, Any]]]:
    texts = replace(
        HEAD, mission=ESCAPES, file=ESCAPES, robot=ESCAPES, world=ESCAPES, params={ESCAPES: ESCAPES},
        versions={ESCAPES: ESCAPES}, command=(ESCAPES,), paths={"mission/greet.yaml": ESCAPES},
        behaviours=(ESCAPES,), mocks=(),
    )  # fmt: skip
    yield "escapes in its head", {"head": texts, "files": {**FILES, ESCAPES: b""}}
    half = "half \ud800 a letter"
    yield "halves of letters in its head", {"head": replace(HEAD, mission=half, command=(half,))}
    seen = ViewItem(1.01, View(1.0, (replace(face(1.0), name=half),)))
    changed = NodeChanged(0.1, 1, "1.1", half, half, 3, "failure", half)
    shown = {"tree": json.dumps(to_json(TREE)).replace("look_for", half).encode(errors="surrogatepass")}
    yield (
        "halves of letters",
        {
            "what": [
                changed,
                VariableSet(0.1, 1, half, half, half),
                *moments(),
                seen,
                PictureItem(1.0, small_picture(9), None),
            ],
            **shown,
        },
    )
    keys = json.dumps(to_json(TREE)).replace('"key": "1.1"', '"key": "failure"')
    yield "keys that are none", {"tree": keys.encode(), "what": [replace(changed, node="9" * 5000), *moments()]}
    yield "halves of letters in its tree", {"tree": json.dumps(to_json(TREE)).replace("look_for", "\\ud800").encode()}
    yield "escapes as mocks", {"head": replace(HEAD, mocks=(ESCAPES,))}
    tree = json.dumps(to_json(TREE)).replace("look_for", json.dumps(ESCAPES)[1:-1]).encode()
    yield "escapes in what happened", {"what": hostile_items(), "tree": tree}
    deep = b"[" * 100_000 + b"]" * 100_000
    for topic in ("/nodes", "/moments", "/percepts", "/camera", "/variables", "/lost", "/state/base"):
        yield f"deep JSON in {topic}", {"raw": [raw(topic, deep)]}
    yield "a deep tree", {"tree": deep}
    nested = written = json.dumps(to_json(TREE))
    box = written[written.index('{"key": "1.1"') : -3]
    for _ in range(300):
        nested = nested.replace('"children": []', f'"children": [{box}]')
    yield "a tree of 300 levels", {"tree": nested.encode()}
    yield "a tree that is none", {"tree": b'{"root": 7}'}


def of_numbers() -> Iterator[tuple[str, dict[str, Any]]]:
    yield "a number of a million digits", {"raw": [raw("/nodes", b"9" * 1_000_000)]}
    stamps: tuple[object, ...] = ("../../evil", 1e308, [], None, -1e18, "9" * 400)
    for stamp in stamps:
        yield (
            f"a picture of time {stamp!s:.12}",
            {"raw": [raw("/camera", {"t": stamp, "data": "AAAA", "gaze": None})]},
        )
    for times in (1e300, float("inf"), -1e300):
        data = json.dumps({"t": times, "tick": 1, "node": "1", "name": "a", "kind": "b", "line": 1, "status": "failure",
                           "reason": ""}).encode()  # fmt: skip
        yield f"a node at {times}", {"raw": [raw("/nodes", data)]}
    array = {"t": 1.0, "counts": {"/nodes": {"$": "array", "of": {"dtype": "O", "shape": [1], "data": "AAAAAAAAAAA="}}}}
    yield from of_figures()
    yield "an array of objects", {"raw": [raw("/lost", array), raw("/variables", {**array, "tick": 1})]}
    yield "a rate of 0", {"head": replace(HEAD, rate=0.0)}
    yield "a rate of 1e308", {"head": replace(HEAD, rate=1e308)}
    yield "20 MB of blanks", {"raw": [raw("/nodes", b" " * 20_000_000)]}


def of_figures() -> Iterator[tuple[str, dict[str, Any]]]:
    many = 10**400  # JSON has it, floats do not
    yield "a log of numbers", {"raw": [raw("/log", {"t": 1.0, "kind": 1, "message": 2.5})]}
    yield "lost words", {"raw": [raw("/lost", {"t": 1.0, "counts": {"/nodes": "many"}})]}
    tick = {"t": 1.0, "kind": "tick", "tick": 7, "late": 0.0, "spent": 0.0, "overheld": None, "answers": []}
    for name, value in (("tick", "7"), ("spent", "inf"), ("late", "nan"), ("kind", []), ("tick", float("nan"))):
        yield f"a tick with {name} {value}", {"raw": [raw("/moments", {**tick, name: value})]}
    base = {"t": 1.0, "quality": "good", "battery_percent": 80.0} | dict.fromkeys(
        ("x", "y", "heading", "speed", "turn", "requested_speed", "requested_turn"), 0.0
    )
    for value in (1e308, -1e308, many):
        yield f"a base at {str(value)[:9]}", {"raw": [
            raw("/state/base", base),
            raw(
                "/state/base",
                {**base, "x": value, "heading": value, "requested_turn": value, "battery_percent": value},
            ),
            raw("/state/base", {**base, "x": -value, "requested_turn": -value}),
        ]}  # fmt: skip
    yield (
        "an end of many digits",
        {
            "raw": [
                raw("/end", {"t": 4.0, "mission": "m", "result": "failure", "reason": "", "seconds": many, "ticks": 1})
            ]
        },
    )
    for value in (float("inf"), float("nan"), 3e9, 1e308):
        seen = replace(face(1.0), box=Box(value, 3e9, value, -value), bearing=value, distance=value, elevation=-value)
        told = {"t": 1.01, **to_fields(View(1.0, (seen,)))}
        yield f"a face at {value}", {"what": [*moments(), PictureItem(1.0, small_picture(9), None)],
                                     "raw": [raw("/percepts", told)]}  # fmt: skip
    view = {"t": 1.0, "looked": many, "faces": [], "things": [], "markers": [], "spent": "x"}
    yield "a look of many digits", {"raw": [raw("/percepts", view)]}


DECIDE = (("record", "rerun", "R"), ("record", "rerun", "R", "--recorded"), ("record", "rerun", "R", "--see"))
TAKE_OUT = (
    ("record", "info", "R"),
    ("record", "export", "R", "--folder", "OUT/folder", "--jsonl", "OUT/lines.jsonl"),
)
LOOK = (
    ("record", "cut", "R", "1s", "2s", "-o", "OUT/piece.mcap"),
    ("record", "replay", "R"),
    ("record", "replay", "R", "--frames", "OUT/frames"),
    ("show", "R", "--at", "2s"),
    ("record", "report", "R", "-o", "OUT/report.html"),
    ("record", "stats", "R"),
    ("record", "joints", "R"),
    ("record", "compare", "R", "R"),
)


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Raise TimeoutError where something takes longer."""

    def late(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def fault_of(capsys: pytest.CaptureFixture[str], words: Sequence[str], record: Path, out: Path) -> str:
    """Run a command on a record; return what is wrong with how it took that."""
    there = set(record.parent.iterdir())
    try:
        with within(COMMAND_TIMEOUT):
            outcome = command(
                capsys, *(str(record) if word == "R" else word.replace("OUT", str(out)) for word in words)
            )
    except TimeoutError:
        return "hangs"
    said = (outcome.out + outcome.err).strip()
    if outcome.code not in (0, 1, 2) or (outcome.code == 2 and not said):
        return f"exits with {outcome.code}: {said[-300:]}"
    return "" if set(record.parent.iterdir()) == there else "leaves something beside the record"


def test_nothing_of_a_malicious_record_is_run_or_waited_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(tmp_path / "FIFO")
    wrong = []
    for number, (about, how) in enumerate(made(tmp_path)):
        place = tmp_path / f"{number}"
        place.mkdir()
        record = write(place / "evil.mcap", **how)
        for words in (*TAKE_OUT, *(DECIDE if {"head", "files"} & how.keys() else LOOK)):
            out = Path(tempfile.mkdtemp(dir=tmp_path))
            if fault := fault_of(capsys, words, record, out):
                wrong.append(f"{about}: {' '.join(words)} {fault}")
        if (tmp_path / "RUN").exists():
            wrong.append(f"{about}: its code was run")
            (tmp_path / "RUN").unlink()
    assert not (tmp_path.parent / "evil").exists()
    assert not wrong, "\n".join(wrong)
    assert number >= 60
