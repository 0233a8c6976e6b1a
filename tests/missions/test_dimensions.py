"""Dimensions: a quantity keeps its own through everything that a mission does with it, and mixtures are refused."""

from pathlib import Path

import pytest

from behaviours.catalogue import LEAVES
from config.diagnostics import InvalidFileError, SourceText
from missions.language.document import check_plan, load_plan
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission
from missions.plugins.testing.mission_run import run_mission

HEAD = """\
mission: m
params:
  gap: 2 m
  angle: 90 deg
  patience: 20 s
  n: 3
  part: 20 %
  ways: [1 m, 50 cm]
  names: [Anna, Ben]
  to: {type: person}
  far: {type: length}
  turns: {type: list, of: angle}
tree:
  sequence:
"""

BEFORE = (
    "find_face:\n      as: face_of",
    "drive: 1 m\n      as: gone",
    "turn: 10 deg\n      as: turned",
    "look: 5 deg\n      as: looked",
    "play: wave\n      as: played",
    "listen: [yes, no]\n      as: answer",
    "faces_at_least: 2\n      as: faces",
    "set: {way: '${base.x + 1 m}', pose: {elbow: 30 deg}, total: 0, word: hello, flag: true}",
    "set: {twice: '${way * 2}', area: '${way * way}', rate: '${way / patience}', off: '${turned - angle}'}",
)


def mission(line: str) -> str:
    return HEAD + "".join(f"    - {each}\n" for each in (*BEFORE, line))


def faults(text: str) -> list[tuple[str, str]]:
    """What the checker has against a mission: what it underlines, and what it says."""
    try:
        check_plan(SourceText("m.yaml", text), LEAVES, LOOKUPS, find_mission=find_mission)
    except InvalidFileError as error:
        found = []
        for fault in error.diagnostics:
            begin = fault.mark.column - 1
            under = fault.source.line(fault.mark.line)[begin : begin + fault.mark.length]
            found.append((under, f"{fault.message}; {fault.suggestion}" if fault.suggestion else fault.message))
        return found
    return []


A_NUMBER = "needs a length such as '0.5 m', got a number; multiply it by 1 m"

WRONG = [
    ("turn: '${gap * 1}'", "gap * 1", "'turn' needs an angle such as '30 deg', got a length"),
    ("drive: {distance: 1 m, speed: '${patience / 20}'}", "patience / 20", "got a duration"),
    ("wait: '${gap + angle}'", "gap + angle", "cannot add a length and an angle"),
    ("drive: '${n * 0.2}'", "n * 0.2", A_NUMBER),
    ("drive: '${far * 1 s}'", "far * 1 s", "needs a length such as '0.5 m', got a quantity in m s"),
    ("drive: '${far - 1}'", "far - 1", "cannot calculate the difference of a length and a number; a plain number"),
    ("drive: '${way + turned}'", "way + turned", "cannot add a length and an angle"),
    ("drive: '${twice / way}'", "twice / way", A_NUMBER),
    ("drive: '${area}'", "area", "needs a length such as '0.5 m', got a quantity in m^2"),
    ("drive: {distance: 1 m, speed: '${area / patience}'}", "area / patience", "got a quantity in m^2/s"),
    ("turn: '${gone}'", "gone", "needs an angle such as '30 deg', got a length"),
    ("turn: '${off * off}'", "off * off", "got a quantity in rad^2"),
    ("turn: '${twice / 1 m}'", "twice / 1 m", "got a number; multiply it by 1 deg or 1 rad"),
    ("turn: '${gap / face_of.distance}'", "gap / face_of.distance", "got a number"),
    ("turn: '${face_of.distance}'", "face_of.distance", "got a length"),
    ("turn: '${face_of.yaw_rate}'", "face_of.yaw_rate", "got a turn rate"),
    ("drive: '${face_of.yaw + gap}'", "face_of.yaw + gap", "cannot add an angle and a length"),
    ("drive: '${faces[0].bearing}'", "faces[0].bearing", "got an angle"),
    ("wait: '${looked.pan}'", "looked.pan", "needs a duration such as '2 s', got an angle"),
    ("wait: '${played.elbow.worst}'", "played.elbow.worst", "got an angle"),
    ("wait: '${base.heading}'", "base.heading", "got an angle"),
    ("turn: '${range.nearest}'", "range.nearest", "got a length"),
    ("wait: '${battery.voltage}'", "battery.voltage", "got a voltage"),
    ("drive: '${battery.percent}'", "battery.percent", "got a percent; multiply it by 1 m"),
    ("drive: '${max(gap, turned)}'", "turned", "cannot compare: a length and an angle"),
    ("drive: '${min(way, 0)}'", "0", "cannot compare: a length and a number"),
    ("turn: '${abs(way)}'", "abs(way)", "got a length"),
    ("turn: '${round(way, 1)}'", "round(way, 1)", "got a length"),
    ("drive: '${len(names)}'", "len(names)", A_NUMBER),
    ("turn: '${ways[0]}'", "ways[0]", "got a length"),
    ("drive: '${turns[-1]}'", "turns[-1]", "got an angle"),
    ("drive: '${way if flag else turned}'", "way if flag else turned", "it is either a length or an angle"),
    ("set: {x: '${way if flag else 2}'}", "way if flag else 2", "it is either a length or a number; a plain number is"),
    (
        "wait: 1 s\n      if: way > 3",
        "way > 3",
        "cannot compare a length and a number; a plain number is not a quantity",
    ),
    ("wait: 1 s\n      if: range.ahead < patience", "range.ahead < patience", "cannot compare a length and a duration"),
    ("wait: 1 s\n      while: base.heading < 30", "base.heading < 30", "multiply it by 1 deg or 1 rad"),
    ("wait: 1 s\n      until: turned == gone", "turned == gone", "cannot compare an angle and a length"),
    ("wait: 1 s\n      timeout: '${way}'", "way", "'timeout' needs a duration such as '2 s', got a length"),
    ("wait: 1 s\n      repeat: '${twice}'", "twice", "'repeat' needs a number, got a length; divide it by 1 m"),
    ("set: {total: '${total + way}'}", "total + way", "cannot add a number and a length"),
    ("set: {x: '${way % 2}'}", "way % 2", "cannot calculate the remainder of a length and a number"),
    ("set: {x: '${gone in turns}'}", "gone in turns", "cannot compare a length and an angle"),
    ("set: {x: '${[way, turned]}'}", "turned", "the members of a list must have one type: a length and an angle"),
    ("say: '${gone + 1} done'", "gone + 1", "cannot add a length and a number"),
    ("say: '${ways[way]}'", "way", "list indexes are whole numbers, not a length"),
    ("turn: '${way} deg'", "way", "'turn': a length is written with its unit; leave 'deg' out, or divide it by 1 m"),
    ("turn: '${total} m'", "total", "needs an angle such as '30 deg', got a length"),
    ("gesture: {gesture: wave, speed: '${gone}'}", "gone", "'gesture': 'speed' needs a number, got a length"),
    ("battery_below: '${gone}'", "gone", "needs a share such as '20 %', got a length"),
    (
        "mission: greet\n      with: {patience: '${way}'}",
        "way",
        "'patience' needs a duration such as '2 s', got a length",
    ),
    ("switch: {on: way > 1, cases: {true: stop}}", "way > 1", "cannot compare a length and a number"),
    ("arc: {radius: 1 m, angle: '${gone / 1 m}'}", "gone / 1 m", "got a number"),
    (
        "say: '${gone} metres'",
        "gone",
        "'say': a length is written with its unit; leave 'metres' out, or divide it by 1 m",
    ),
    ("log: 'in ${n} s, or ${gap * n} m'", "gap * n", "a length is written with its unit; leave 'm' out"),
    (
        "wait: 1 s\n      if: battery.percent < part",
        "battery.percent < part",
        "cannot compare a percent and a share; a percent value",
    ),
    ("battery_below: '${battery.percent}'", "battery.percent", "needs a share such as '20 %', got a percent"),
    ("for_each: {in: ways, as: w, do: {turn: '${w}'}}", "w", "needs an angle such as '30 deg', got a length"),
    ("for_each: {in: [1 s], as: w, number: k, do: {turn: '${w * k}'}}", "w * k", "got a duration"),
    # A text is compared with no number, and calculated with no more.
    ("wait: 1 s\n      if: answer == 3", "answer == 3", "cannot compare a text and a number"),
    ("wait: 1 s\n      if: n == 'three'", "n == 'three'", "cannot compare a number and a text"),
    ("wait: 1 s\n      if: face.name < 2", "face.name < 2", "cannot compare a text and a number"),
    ("wait: 1 s\n      if: to in [1, 2]", "to in [1, 2]", "cannot compare a text and a number"),
    ("wait: 1 s\n      if: face.seen == 1", "face.seen == 1", "cannot compare true or false and a number"),
    ("wait: 1 s\n      if: names == 'a'", "names == 'a'", "cannot compare a list and a text"),
    ("wait: 1 s\n      if: far in gap", "far in gap", "'in' needs a list or a text, not a length"),
    ("wait: 1 s\n      if: ways == [1 s]", "ways == [1 s]", "cannot compare a length and a duration"),
    ("set: {x: '${word + 1}'}", "word", "cannot calculate with a text"),
    ("drive: '${answer}'", "answer", "needs a length such as '0.5 m', got a text"),
]


def test_mixed_dimensions_are_refused_at_their_place() -> None:
    missed = []
    for line, under, message in WRONG:
        found = faults(mission(line))
        if len(found) != 1 or found[0][0] != under or message not in found[0][1]:
            missed.append(f"{line}: {found}")
    assert missed == []


RIGHT = [
    "turn: '${gone / 1 m * 90 deg}'",
    "turn: '${angle * n / 2}'",
    "turn: '${off}'",
    "turn: '${face_of.bearing + looked.pan}'",
    "turn: '${total * 3} deg'",
    "drive: {distance: '${far}', speed: '${gap / patience}'}",
    "drive: {distance: '${max(far, 0 m)}', speed: '${rate}'}",
    "drive: '${twice / 2}'",
    "drive: '${far * part}'",
    "drive: '${gone if flag else 20 cm}'",
    "say: '${gone if flag else \"nothing\"}'",
    "drive: '${area / way}'",
    "drive: '${abs(round(way, 2)) + ways[-1] + min(ways)}'",
    "drive: '${turned / 1 rad * 30 cm}'",
    "wait: '${1 / 2 Hz}'",
    "wait: '${gone / 0.2 m/s}'",
    "wait: 1 s\n      if: face_of.distance < 1.5 m and base.heading > 20 deg",
    "wait: 1 s\n      if: answer == 'yes' and to in names and word != null",
    "wait: 1 s\n      if: names == ['a', 'b'] and ways != [] and face_of != null and ways != null",
    "wait: 1 s\n      while: battery.percent > 20",
    "wait: 1 s\n      repeat: '${n + total}'",
    "battery_below: '${part / 2}'",
    "battery_below: '${part + 0.1}'",
    "move_joints: {to: '${pose}'}",
    "say: '${gone} and ${turned * n} and ${face.count + 1}'",
    "mission: greet\n      with: {patience: '${patience * 2}'}",
    "for_each: {in: ways, as: w, number: k, do: {drive: '${w * k}'}}",
    "say: '${face_of.distance / 1 m} metres, ${n} m, ${gone} more, ${word} s'",
]


def test_consistent_dimensions_are_accepted() -> None:
    assert [(line, found) for line in RIGHT if (found := faults(mission(line)))] == []


def test_text_that_looks_like_an_expression_gets_a_hint() -> None:
    for text in ("n - 1", "gap * 2", "n > 2", "ways[0]", "max(n, 1)", "not flag"):
        hint = f'write x: "${{{text}}}", or quotes around it for the text'
        message = f"'x' is set to the text '{text}', which is not calculated; {hint}"
        assert faults(mission(f"set:\n        x: {text}")) == [(text, message)]
    for text in (
        "n",
        "word",
        "'n - 1'",
        '"n - 1"',
        "kitchen - 2",
        "well-known",
        "n -",
        "3 m",
        "Hello, Anna",
        "${n - 1}",
    ):
        assert faults(mission(f"set:\n        x: {text}")) == []


def written(folder: Path, **missions: str) -> Path:
    for name, text in missions.items():
        (folder / f"{name}.yaml").write_text(f"mission: {name}\n{text}")
    return folder / f"{next(iter(missions))}.yaml"


INNER = """\
params: {side: 1 m, times: 1}
tree: {set: {area: "${side * side}", way: "${side * times}"}}
returns: {area: area, way: way, speed: way / 1 s}
"""


def test_quantity_keeps_its_dimension_through_a_submission(tmp_path: Path) -> None:
    outer = """\
tree:
  sequence:
    - {mission: inner.yaml, with: {side: 2 m}}
    - {mission: inner.yaml, with: {side: "${way}", times: "${area / 1 m / way}"}, as: all}
    - say: ${area}, ${all.area}, ${all.way}, ${speed}
    - say: ${all.area / all.way / 1 m * 90 deg}
"""
    assert run_mission(written(tmp_path, outer=outer, inner=INNER)).said == ["4 m^2, 4 m^2, 4 m, 2 m/s", "90 deg"]
    for line, under, message in (
        ("wait: ${way}", "way", "needs a duration such as '2 s', got a length"),
        ("turn: ${all.sped}", "all.sped", "'sped' is not there"),
        ("turn: ${all.speed}", "all.speed", "needs an angle such as '30 deg', got a speed"),
        ("drive: ${all.area + way}", "all.area + way", "cannot add a quantity in m^2 and a length"),
        ('mission: inner.yaml\n      with: {side: "${speed}"}', "speed", "needs a length such as '0.5 m', got a speed"),
        (
            "mission: inner.yaml\n      returns: {b: way + area}",
            "way + area",
            "cannot add a length and a quantity in m^2",
        ),
    ):
        path = written(tmp_path, outer=f"{outer}    - {line}\n", inner=INNER)
        with pytest.raises(InvalidFileError) as caught:
            load_plan(path, LEAVES, LOOKUPS, find_mission=find_mission)
        (fault,) = caught.value.diagnostics
        begin = fault.mark.column - 1
        assert fault.source.line(fault.mark.line)[begin:][: fault.mark.length] == under
        assert fault.message.endswith(message)


def test_mistake_in_a_submission_used_twice_is_reported_once(tmp_path: Path) -> None:
    outer = "tree:\n  sequence:" + "\n    - {mission: inner.yaml, with: {side: '${a}'}}" * 2 + "\n"
    inner = "params: {side: 1 m}\ntree: {drive: '${side + 1}'}\n"
    path = written(tmp_path, outer=f"params: {{a: {{type: length}}}}\n{outer}", inner=inner)
    with pytest.raises(InvalidFileError) as caught:
        load_plan(path, LEAVES, LOOKUPS, find_mission=find_mission)
    assert [fault.place.rpartition("/")[2] for fault in caught.value.diagnostics] == ["inner.yaml:3:18"]


def test_node_fails_with_both_dimensions_for_a_variable_of_unknown_type(tmp_path: Path) -> None:
    for line, reason in (
        ("turn: ${x}", "angle: needs an angle such as '30 deg', got a length: '2 m'"),
        ("turn: ${x + 1 deg}", "angle: 'x + 1 deg': cannot add a length and an angle"),
        ("turn: ${x * x}", "angle: needs an angle such as '30 deg', got a quantity: '4 m^2'"),
        ("turn: ${x / 1 m}", "angle: needs an angle such as '30 deg', got the number 2: multiply it by 1 deg or 1 rad"),
        ("succeed:\n      if: x > 3", "if: 'x > 3': cannot compare a length and a number"),
        ("gesture: {gesture: wave, speed: '${x}'}", "speed: needs a number, got '2 m'"),
    ):
        text = f"tree:\n  sequence:\n    - set: {{x: hello}}\n    - set: {{x: 2 m}}\n    - {line}\n"
        ran = run_mission(written(tmp_path, unknown=text))
        assert ran.result == "failure"
        assert reason in ran.reason


def test_stored_and_sensed_values_have_dimensions_in_a_run(tmp_path: Path) -> None:
    text = """\
tree:
  sequence:
    - drive: 50 cm
      as: gone
    - turn: 90 deg
      as: turned
    - look: 20 deg
      as: looked
    - set: {x: "${round(gone + 1 m, 1)}", y: "${round(base.heading + turned)}", z: "${looked.pan + head.pan > 20 deg}"}
    - say: ${x}, ${y}, ${z}
returns: {x: x}
"""
    ran = run_mission(written(tmp_path, sensing=text))
    assert (ran.result, ran.said) == ("success", ["1.5 m, 180 deg, yes"])
    assert ran.returns["x"] == pytest.approx(1.5)
