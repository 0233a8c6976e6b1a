"""The XML reader keeps lines and comments, and refuses everything that could read more than the file."""

from pathlib import Path

import pytest

from config.diagnostics import InvalidFileError
from missions.plugins.interchange.xml_reader import (
    MAX_ATTRIBUTES,
    MAX_DEPTH,
    MAX_ELEMENTS,
    MAX_VALUE_LENGTH,
    parse_xml,
    read_xml,
)
from tests.behaviortree_cpp import ask_behaviortree_cpp, needs_behaviortree_cpp


def refusal(data: bytes) -> str:
    with pytest.raises(InvalidFileError) as caught:
        parse_xml(data, "tree.xml")
    return str(caught.value)


def test_elements_keep_lines_attributes_and_comments() -> None:
    root = parse_xml(
        b"<!-- head -->\n<root>\n  <!-- walk -->\n  <A x='1'/>\n  <!-- end -->\n</root>\n<!-- last -->", "f"
    )
    (child,) = root.children
    assert (root.line, child.line, child.attributes) == (2, 4, {"x": "1"})
    assert (root.comments, child.comments, root.last_comments) == ([" head "], [" walk "], [" end ", " last "])


@pytest.mark.parametrize(
    "head",
    [
        b'<!DOCTYPE root SYSTEM "file:///etc/passwd">',
        b'<!DOCTYPE root [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        b'<!DOCTYPE root [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>',
    ],
)
def test_document_types_and_entities_are_refused(head: bytes) -> None:
    assert "document type" in refusal(head + b"<root>&x;</root>")


def test_limits_are_enforced_with_their_place() -> None:
    assert "tree.xml:1:" in refusal(b"<a>" * (MAX_DEPTH + 1) + b"</a>" * (MAX_DEPTH + 1))
    assert "nested too deeply" in refusal(b"<a>" * (MAX_DEPTH + 1) + b"</a>" * (MAX_DEPTH + 1))
    assert "elements" in refusal(b"<a>" + b"<b/>" * MAX_ELEMENTS + b"</a>")
    assert "attributes" in refusal(
        b"<a " + b" ".join(b"x%d='1'" % number for number in range(MAX_ATTRIBUTES + 1)) + b"/>"
    )
    assert "characters" in refusal(b"<a x='" + b"1" * (MAX_VALUE_LENGTH + 1) + b"'/>")
    assert "characters" in refusal(b"<a>" + b"1" * (MAX_VALUE_LENGTH + 1) + b"</a>")
    assert "characters" in refusal(b"<a><!--" + b"1" * (MAX_VALUE_LENGTH + 1) + b"--></a>")


def test_mistakes_are_reported_with_line_and_column() -> None:
    assert "tree.xml:2:" in refusal(b"<root>\n<A></B></root>")
    assert "not well-formed" in refusal(b"<root>\n<A></B></root>")
    assert "unknown encoding 'utf-7'" in refusal(b'<?xml version="1.0" encoding="UTF-7"?><root/>')
    assert "no element found" in refusal(b"")


def test_other_encodings_and_control_characters_are_read() -> None:
    latin = '<?xml version="1.0" encoding="ISO-8859-1"?><a x="Tür"/>'.encode("latin-1")
    assert parse_xml(latin, "f").attributes == {"x": "Tür"}
    assert parse_xml("<a x='Tür'/>".encode("utf-16"), "f").attributes == {"x": "Tür"}
    assert parse_xml(b"<a x='1&#x85;2'/>", "f").attributes == {"x": "1 2"}


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    with pytest.raises(InvalidFileError, match="cannot be read"):
        read_xml(tmp_path)
    with pytest.raises(InvalidFileError, match="cannot be read"):
        read_xml(tmp_path / "missing.xml")


LENIENT = {
    "<!-- a -- b --><root/>": ({}, [" a - b "]),
    "<!---------><root/>": ({}, [""]),
    "<root code='a < b && c'/>": ({"code": "a < b && c"}, []),
    "<root x='1'y=\"it's &nbsp; &#60;&amp;\"/>": ({"x": "1", "y": "it's &nbsp; <&"}, []),
    "\n  <?xml version='1.0'?>\n<root z='a & b'/>": ({"z": "a & b"}, []),
    "<root>a & b</root>": ({}, []),
}


@pytest.mark.parametrize("text", LENIENT)
def test_markup_that_behaviortree_cpp_accepts_is_read(text: str) -> None:
    root = parse_xml(text.encode(), "tree.xml")
    assert (root.attributes, root.comments) == LENIENT[text]
    assert root.line == text.count("\n") + 1


@needs_behaviortree_cpp
def test_behaviortree_cpp_accepts_that_markup() -> None:
    body = "{}<BehaviorTree ID='M'><Script {}/></BehaviorTree>"
    heads = ("<!-- a -- b -->", "<!--------->", "a & b", "\n")
    trees = [body.format(head, "code='a := 1'name='b'") for head in heads]
    trees += [body.format("", each) for each in ("code='a := 1 < 2'", "code='a := 1' name=\"it's &nbsp; & b\"")]
    requests = [{"xml": f"<root BTCPP_format='4'>{tree}</root>", "nodes": {}} for tree in trees]
    assert ask_behaviortree_cpp(requests) == [[]] * len(requests)


@pytest.mark.parametrize(
    "text",
    [
        "<a b='1' b='2'/>",
        "<a b=1/>",
        "<a b/>",
        "<a, b='1'/>",
        "<a/ >",
        "<a></b>",
        "<a><b></a>",
        "<a",
        "<a b='",
        "<!--<a/>",
    ],
)
def test_other_mistakes_are_refused_with_their_place(text: str) -> None:
    assert "tree.xml:1:" in refusal(text.encode())


@pytest.mark.parametrize("piece", ["<!--", "<![CDATA[", "<?", "<a b='", "<a b=\"'", "<a b='' ", "&", "<", "-", "</"])
def test_long_broken_markup_is_refused(piece: str) -> None:
    assert "tree.xml:1:" in refusal(b"<root>" + piece.encode() * (1_000_000 // len(piece)))
