"""Reader of XML files from other programs: elements with line numbers and comments, under strict limits.

The file is hostile input: a document type, an entity or a processing instruction for style sheets cannot make the
reader open another file or grow in memory. Nothing but the given text is read.
"""

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from config.diagnostics import Diagnostic, InvalidFileError, Mark, SourceText
from config.file_io import read_regular

MAX_BYTES = 4_000_000
"""Maximum size of an XML file in bytes."""

MAX_DEPTH = 100
"""Maximum depth of nested XML elements, equal to that of steps in a mission."""

MAX_ELEMENTS = 20_000
MAX_ATTRIBUTES = 200
"""Maximum number of attributes of one XML element."""

MAX_NAME_LENGTH = 200
"""Maximum characters of the name of an XML element or attribute."""

MAX_VALUE_LENGTH = 20_000
"""Maximum characters of the value of an attribute, of a text between elements, or of a comment."""

ENCODINGS = ("utf-8", "utf8", "us-ascii", "ascii", "iso-8859-1", "latin-1", "utf-16")
DECLARED_ENCODING = re.compile(rb"""\A[^>]{0,200}?<\?xml[^>]{0,200}?encoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
MARKUP = re.compile(
    r"""<!--(?P<comment>.*?)(?:-->|\Z) | (?P<declaration><\?xml\b[^>]*+>)
    | <!\[CDATA\[.*?(?:\]\]>|\Z) | <[?!][^>]*+(?:>|\Z)
    | <(?P<name>/?[^\s"'<>=/?!]++)(?P<attributes>(?:\s*+[^\s"'<>=/]++\s*+=\s*+(?:"[^"]*"|'[^']*'))*+)\s*+(?P<end>/?)>
    | (?P<text>[^<]++)
    """,
    re.DOTALL | re.VERBOSE,
)
ATTRIBUTE = re.compile(r"""([^\s"'<>=/]++)(\s*+=\s*+)("[^"]*"|'[^']*')""")
BARE_AMPERSAND = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#[0-9]{1,7}|#x[0-9A-Fa-f]{1,6});)")
CONTROL_CHARACTERS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")


@dataclass(slots=True)
class Element:
    """An element of an XML file, with its position in the file.

    ``comments`` are the XML comments directly before it, ``last_comments`` those behind its last child. ``text`` is the
    text in it, without that of its children.
    """

    tag: str
    attributes: dict[str, str]
    source: SourceText
    line: int
    column: int = 1
    children: list["Element"] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    last_comments: list[str] = field(default_factory=list)
    text: str = ""

    def fault(self, message: str, hint: str = "") -> InvalidFileError:
        """Return an InvalidFileError whose position is this element."""
        return InvalidFileError([Diagnostic(self.source, Mark(self.line, self.column), message, hint)])


def walk_elements(element: Element) -> Iterator[Element]:
    """Yield an element and all elements below it."""
    yield element
    for child in element.children:
        yield from walk_elements(child)


def read_xml(path: Path, name: str | None = None) -> Element:
    """Read an XML file. Raises InvalidFileError: unreadable, too large, or refused by ``parse_xml``."""
    label = str(path) if name is None else name
    try:
        data = read_regular(path, MAX_BYTES)
    except OSError as error:
        reason = f"cannot be read: {error.strerror or error}"
        raise InvalidFileError([Diagnostic(SourceText(label, ""), Mark(), reason)]) from error
    return parse_xml(data, label)


def parse_xml(data: bytes, name: str) -> Element:
    """Return the root element of the XML text ``data``; ``name`` is the file's name for errors.

    Raises InvalidFileError for text that is not well-formed, too large or nested too deeply, and for a document type.
    """
    found = DECLARED_ENCODING.match(data)
    encoding = found[1].decode().lower() if found else "utf-8"
    source = SourceText(name, data.decode("utf-8", errors="replace"))
    if encoding not in ENCODINGS:
        raise InvalidFileError([Diagnostic(source, Mark(), f"unknown encoding '{encoding}'", "save it as UTF-8")])
    try:
        return _Builder(source).build(data)
    except _NotWellFormedError as error:
        mended = _mended_markup(data.decode("utf-8" if "utf-16" in encoding else encoding, errors="replace"))
        with suppress(_NotWellFormedError):
            return _Builder(source).build(mended.encode())
        raise InvalidFileError(error.diagnostics) from None


class _NotWellFormedError(InvalidFileError):
    """Text that does not follow the grammar of XML."""


def _mended_markup(text: str) -> str:
    """Return well-formed XML for markup that BehaviorTree.CPP accepts.

    Its reader, TinyXML-2, allows "--" in a comment, "<" and "&" in a value, attributes without a space between them,
    and blanks before the declaration. Lines stay where they are.
    """
    return MARKUP.sub(_mended_token, text)


def _mended_token(found: re.Match[str]) -> str:
    comment, name, attributes, end, text = found.group("comment", "name", "attributes", "end", "text")
    if comment is not None:
        return f"<!--{re.sub('-{2,}', '-', comment).removesuffix('-')}-->"
    if text is not None:
        return BARE_AMPERSAND.sub("&amp;", text)
    if found["declaration"]:
        return ""  # it may stand only at the very beginning of well-formed XML
    if not attributes:
        return found[0]
    escaped = BARE_AMPERSAND.sub("&amp;", attributes)
    spaced = ATTRIBUTE.sub(lambda each: f" {each[1]}{each[2]}{each[3].replace('<', '&lt;')}", escaped)
    return f"<{name}{spaced}{end}>"


class _Builder:
    """Builds the elements from the events of the XML parser expat; checks each limit before it stores a text."""

    def __init__(self, source: SourceText) -> None:
        self._source = source
        self._open: list[Element] = []
        self._root: Element | None = None
        self._count = 0
        self._comments: list[str] = []
        self._parser = expat.ParserCreate()
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CommentHandler = self._comment
        self._parser.CharacterDataHandler = self._characters
        self._parser.StartDoctypeDeclHandler = self._refuse_document_type
        self._parser.EntityDeclHandler = self._refuse_document_type

    def build(self, data: bytes) -> Element:
        try:
            self._parser.Parse(data, True)
        except expat.ExpatError as error:
            mark = Mark(error.lineno, error.offset + 1)
            reason = f"not well-formed XML: {expat.ErrorString(error.code)}"
            raise _NotWellFormedError([Diagnostic(self._source, mark, reason)]) from None
        except (UnicodeError, LookupError, ValueError) as error:
            if isinstance(error, InvalidFileError):
                raise
            raise self._fault(f"not readable as XML: {error}") from None
        if self._root is None:
            raise self._fault("an empty file")
        self._root.last_comments += self._comments
        return self._root

    def _fault(self, message: str, hint: str = "") -> InvalidFileError:
        mark = Mark(max(1, self._parser.CurrentLineNumber), self._parser.CurrentColumnNumber + 1)
        return InvalidFileError([Diagnostic(self._source, mark, message, hint)])

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > MAX_ELEMENTS:
            raise self._fault(f"more than {MAX_ELEMENTS:,} elements")
        if len(self._open) >= MAX_DEPTH:
            raise self._fault(f"nested too deeply: at most {MAX_DEPTH} elements")
        if len(attributes) > MAX_ATTRIBUTES:
            raise self._fault(f"more than {MAX_ATTRIBUTES} attributes")
        if max(map(len, (tag, *attributes))) > MAX_NAME_LENGTH:
            raise self._fault(f"a name of more than {MAX_NAME_LENGTH} characters")
        for name, value in attributes.items():
            self._check_length(value, f"attribute '{name[:40]}'")
        line, column = self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1
        cleaned = {name: clean_text(value) for name, value in attributes.items()}
        element = Element(tag, cleaned, self._source, line, column, comments=self._comments)
        self._comments = []
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root = element
        self._open.append(element)

    def _end(self, tag: str) -> None:
        del tag
        self._open.pop().last_comments += self._comments
        self._comments = []

    def _comment(self, text: str) -> None:
        self._check_length(text, "a comment")
        self._comments.append(clean_text(text))

    def _characters(self, text: str) -> None:
        if self._open and text.strip():
            self._open[-1].text += clean_text(text)
            self._check_length(self._open[-1].text, "a text")

    def _check_length(self, text: str, label: str) -> None:
        if len(text) > MAX_VALUE_LENGTH:
            raise self._fault(f"{label} of more than {MAX_VALUE_LENGTH:,} characters")

    def _refuse_document_type(self, *_: object) -> None:
        raise self._fault("a document type or an entity, which is refused", "remove <!DOCTYPE ...> from the file")


def clean_text(text: str) -> str:
    """Return a text without characters that XML or mission files cannot contain, such as control characters."""
    return CONTROL_CHARACTERS.sub(" ", text)
