"""YAML with positions: what words mean, where nodes stand, and that nothing a file holds can do harm."""

from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText
from config.yaml_nodes import (
    MAX_BYTES,
    MAX_DEPTH,
    MAX_NODES,
    Listing,
    Mapping,
    Node,
    Scalar,
    compose,
    plain_value,
    read_source,
)

GREET = (Path(__file__).parents[2] / "missions" / "greet.yaml").read_text(encoding="utf-8")

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n" for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)


def read(text: str) -> Node:
    return compose(SourceText("robot.yaml", text))


def mistakes(text: str) -> tuple[Diagnostic, ...]:
    with pytest.raises(InvalidFileError) as caught:
        read(text)
    return caught.value.diagnostics


def the_mistake(text: str) -> Diagnostic:
    (fault,) = mistakes(text)
    return fault


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("true", True),
        ("false", False),
        ("null", None),
        ("~", None),
        ("", None),
        ("12", 12),
        ("-3", -3),
        ("+5", 5),
        ("007", 7),
        ("1_000", 1000),
        ("1.5", 1.5),
        (".5", 0.5),
        ("5.", 5.0),
        ("1e3", 1000.0),
        ("-1.5E-3", -0.0015),
    ],
)
def test_plain_scalars_follow_yaml_1_2(written: str, meant: object) -> None:
    found = plain_value(written)
    assert found == meant
    assert type(found) is type(meant)


@pytest.mark.parametrize(
    "word",
    ["yes", "on", "off", "True", "12:30", "0x1F", "0o17", "1__0", "1_", "_1", "1_.5", ".", "-", "e5", "٣", "½", ".inf"],
)
def test_other_scalars_stay_text(word: str) -> None:
    assert plain_value(word) == word


@pytest.mark.parametrize("number", ["1e999", "-1e999", "9" * 400, "9" * 5000, "1" + "_0" * 5000])
def test_too_large_number_stays_text(number: str) -> None:
    assert plain_value(number) == number


def test_yaml_nodes_have_marks_and_keep_the_file_order() -> None:
    root = read("robot: r2\nports: [a, 'b c']\n")
    assert isinstance(root, Mapping)
    assert list(root.keys()) == ["robot", "ports"]
    ports = root.get("ports")
    assert isinstance(ports, Listing)
    first, second = ports.items
    assert isinstance(first, Scalar)
    assert isinstance(second, Scalar)
    assert (first.mark, first.value, first.quoted) == (Mark(2, 9, 1), "a", False)
    assert (second.mark, second.value, second.quoted) == (Mark(2, 12, 5), "b c", True)
    assert root.get("missing") is None


def test_a_quoted_number_is_a_text() -> None:
    root = read("'12'")
    assert isinstance(root, Scalar)
    assert root.value == "12"


def test_windows_line_ends_and_a_byte_order_mark_do_not_matter(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_bytes(b"\xef\xbb\xbfrobot: r2\r\nrate: 20 Hz\r\n")
    root = compose(read_source(file))
    assert isinstance(root, Mapping)
    rate = root.get("rate")
    assert isinstance(rate, Scalar)
    assert (rate.text, rate.mark) == ("20 Hz", Mark(2, 7, 5))


def test_alias_is_the_node_of_its_anchor() -> None:
    root = read("a: &one [1, 2]\nb: *one\n")
    assert isinstance(root, Mapping)
    assert root.get("a") is root.get("b")


def test_duplicate_key_is_reported_with_its_first_line() -> None:
    fault = the_mistake("a: 1\nb: 2\na: 3\n")
    assert (fault.mark, fault.message) == (Mark(3, 1, 1), "'a' is a duplicate key (first at line 1)")


def test_recoverable_faults_are_collected() -> None:
    faults: list[Diagnostic] = []
    root = compose(SourceText("m.yaml", "a: 1\na: 2\nb: !x 3\n"), faults)
    assert isinstance(root, Mapping)
    assert [fault.mark.line for fault in faults] == [2, 3]


@pytest.mark.parametrize(
    ("text", "mark", "message", "suggestion"),
    [
        ("a:\n\tb: 1\n", Mark(2, 1), "a tab in the indentation", "indent with spaces"),
        ("- find_face\n  timeout: 5 s\n", Mark(1, 3, 9), "so it needs a colon", "write '- find_face:'"),
        ("a: {b: ${c}}\n", Mark(1, 8, 4), "needs quotes", 'write "${c}"'),
        ("a: {b: [x, ${c}, y]}\n", Mark(1, 12, 4), "needs quotes", 'write "${c}"'),
        ("a: b: c\n", Mark(1, 5), "a second ': '", "put quotes around"),
        ("a:\n  -b: c\n  -d\n", Mark(2, 3), "a dash without a space after it", "write '- b: c'"),
        ("a:\n  - b: c\n  -d\n  - e\n", Mark(3, 3), "a dash without a space after it", "write '- d'"),
        ("a:\n  -b: c\n  - d\n", Mark(2, 3), "a dash without a space after it", "write '- b: c'"),
        ("a:\n  - b: c\n  -d: e\n", Mark(3, 3), "a dash without a space after it", "write '- d: e'"),
        ("a:\n  b: -c\n  - d\n", Mark(3, 3), "unexpected indentation", "indent it like the lines around it"),
        ("a b\nc: d\n", Mark(1, 1, 1), "'a' lacks a colon", "write 'a: b'"),
        ("a b\n c: d\n", Mark(2, 3), "a colon is not expected here", "the line above lacks a colon"),
        ('a: "b\nc: d\n', Mark(1, 4), "unclosed quote", ""),
        ("a: [b, c\nd: e\n", Mark(1, 4), "'[' needs a ','", ""),
        ("a: {b: c\nd: e\n", Mark(1, 4), "'{' needs a ','", ""),
        ("a:\n    b: 1\n   c: 2\n", Mark(3, 4), "unexpected indentation", "indent it like the lines around it"),
        (
            "tree:\n  - find_face:\n  as: person\n  - say: hi\n",
            Mark(3, 3, 2),
            "'as' stands under the dash",
            "indent it by two more spaces, under 'find_face'",
        ),
        (
            "tree:\n  sequence:\n  - find_face: {new: true}\n  # who\n  as: person\n  retry: 2\n\n  - say: hi\n",
            Mark(5, 3, 2),
            "'as' stands under the dash",
            "indent it by two more spaces, under 'find_face'",
        ),
        (
            "s:\n  - selector:\n      - a\n      - b: 1\n  name: x\n",
            Mark(5, 3, 4),
            "'name' stands under the dash",
            "under 'selector'",
        ),
        ("s:\n  - a: 1\n - b: 2\n", Mark(3, 2), "unexpected indentation", "indent it like the lines around it"),
        ("a: @b\n", Mark(1, 4), "'@' cannot begin a text", "put quotes around"),
        ("a: *b*\n", Mark(1, 4), "'*' cannot begin a text", "put quotes around"),
        ("a: *b\n", Mark(1, 4, 2), "unknown alias '*b'", "put quotes around"),
        ("a: &b [*b]\n", Mark(1, 8, 2), "refers to itself", ""),
        ("a: !b c\n", Mark(1, 4, 4), "YAML tags are not supported", "put quotes around"),
        ("? [a]\n: b\n", Mark(1, 3), "a key must be a plain word", "in quotes"),
        ("a: 1\n---\nb: 2\n", Mark(2, 1, 3), "a second document begins here", "a file of its own"),
        ("", Mark(), "the file is empty", ""),
        ("# nothing\n", Mark(), "the file is empty", ""),
        ("a: 1\nb: x\0y\n", Mark(2, 5), "YAML does not allow: U+0000", ""),
        ("a: \x1b[31m\n", Mark(1, 4), "YAML does not allow: U+001B", ""),
    ],
)
def test_yaml_fault_is_reported_with_position_and_suggestion(
    text: str, mark: Mark, message: str, suggestion: str
) -> None:
    fault = the_mistake(text)
    assert message in fault.message
    assert suggestion in fault.suggestion
    assert fault.mark == mark


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
def test_deep_nesting_is_refused(opening: str) -> None:
    assert f"nested more than {MAX_DEPTH} deep" in the_mistake(opening * 10_000).message


def test_aliases_cannot_nest_deeper_than_anything_else() -> None:
    half = MAX_DEPTH // 2 + 1
    text = f"a: &a {'[' * half}x{']' * half}\nb: {'[' * half}*a{']' * half}\n"
    fault = the_mistake(text)
    assert (fault.mark.line, fault.message) == (2, f"nested more than {MAX_DEPTH} deep")


def test_yaml_bomb_is_refused_by_its_expanded_size() -> None:
    assert f"more than {MAX_NODES:,} nodes" in the_mistake(BOMB).message


def test_a_file_with_too_many_nodes_is_refused() -> None:
    assert "more than" in the_mistake("- x\n" * (MAX_NODES + 1)).message


def test_too_large_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "big.yaml"
    file.write_bytes(b"#" * (MAX_BYTES + 1))
    with pytest.raises(InvalidFileError, match="larger than 1,000,000 bytes"):
        read_source(file)


def test_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InvalidFileError, match=r"gone\.yaml:1:1: cannot be read: No such file"):
        read_source(tmp_path / "gone.yaml")


def test_invalid_utf_8_byte_is_reported_with_position(tmp_path: Path) -> None:
    file = tmp_path / "latin.yaml"
    file.write_bytes("é: 1\nsay: größe\n".encode() + b"name: caf\xe9\n")
    with pytest.raises(InvalidFileError) as caught:
        read_source(file, "latin.yaml")
    (fault,) = caught.value.diagnostics
    assert (fault.mark, fault.message) == (Mark(3, 10), "not UTF-8: byte 0xe9")
    assert fault.suggestion == "save the file as UTF-8"


def test_source_can_have_a_display_name(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text("x: 1\n", encoding="utf-8")
    assert read_source(file, "shown.yaml") == SourceText("shown.yaml", "x: 1\n")


def composes_or_says_why(text: str) -> None:
    source = SourceText("any.yaml", text)
    try:
        compose(source)
    except InvalidFileError as error:
        lines = (text + "x").splitlines()
        for fault in error.diagnostics:
            assert fault.message
            assert 1 <= fault.mark.line <= len(lines) + 1
            assert str(fault).startswith(fault.place)


@settings(deadline=None, max_examples=300)
@given(st.text(st.characters(exclude_categories=()), max_size=200))
@example("\ud800")
@example("a: \x85b\u2028c: [")
@example("%YAML 9.9\n---\na")
@example("\ufeff\ufeffa")
def test_no_text_does_more_than_be_refused(text: str) -> None:
    composes_or_says_why(text)


@settings(deadline=None, max_examples=300)
@given(st.lists(st.sampled_from([*"abc:-?[]{},&*!|>'\"%@`#$ \t\n", "\n  ", "- ", ": ", "${", "<<: "]), max_size=60))
def test_no_heap_of_yaml_signs_does_more_than_be_refused(signs: list[str]) -> None:
    composes_or_says_why("".join(signs))


@settings(deadline=None)
@given(st.integers(0, len(GREET) - 1), st.integers(1, 40), st.text("\t\n :-[]{}'\"$&*!ax", max_size=4))
def test_a_mission_with_a_piece_exchanged_composes_or_is_refused(start: int, length: int, instead: str) -> None:
    composes_or_says_why(GREET[:start] + instead + GREET[start + length :])
