"""Writer of XML files for BehaviorTree.CPP and its editor Groot2, with comments and indentation."""

from collections.abc import Iterator
from xml.sax.saxutils import escape

from missions.plugins.interchange.xml_reader import Element, clean_text

ENTITIES = {'"': "&quot;", "\n": "&#10;", "\t": "&#9;"}
MAX_LINE_LENGTH = 110


def xml_text(root: Element) -> str:
    """Return the text of an XML file with this root element."""
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + "\n".join(element_lines(root, 0)) + "\n"


def element_lines(element: Element, depth: int) -> Iterator[str]:
    """Yield the lines of an element that is ``depth`` levels below the root."""
    indent = "  " * depth
    yield from _comments(element.comments, indent)
    start = _start_tag(element, indent)
    if element.children:
        yield f"{start}>"
        for child in element.children:
            yield from element_lines(child, depth + 1)
        yield from _comments(element.last_comments, f"{indent}  ")
        yield f"{indent}</{element.tag}>"
    elif element.text:
        yield f"{start}>{escape(clean_text(element.text))}</{element.tag}>"
    else:
        yield f"{start}/>"


def _comments(comments: list[str], indent: str) -> Iterator[str]:
    for comment in comments:
        # Two hyphens cannot stand in a comment, and no hyphen at its end.
        text = " ".join(clean_text(comment).split()).replace("--", "- -").replace("--", "- -")
        yield f"{indent}<!-- {text} -->"


def _start_tag(element: Element, indent: str) -> str:
    written = [f'{name}="{escape(clean_text(value), ENTITIES)}"' for name, value in element.attributes.items()]
    line = f"{indent}<{element.tag}{''.join(f' {each}' for each in written)}"
    if len(line) <= MAX_LINE_LENGTH:
        return line
    space = f"\n{indent}{' ' * (len(element.tag) + 2)}"
    return f"{indent}<{element.tag} {space.join(written)}"
