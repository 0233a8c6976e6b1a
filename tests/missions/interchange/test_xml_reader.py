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
