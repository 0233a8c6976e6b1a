"""The check of wording finds slips, and leaves plain sentences alone."""

import pytest

from tests.wording import Rules, class_doubles, code_slips, page_slips

RULES = Rules.read()


@pytest.mark.parametrize(
    "source",
    [
        '"""Return what is sent."""',
        'class Base:\n    """Base of a robot."""\n\n    def stop(self) -> None:\n        """It stops anew."""',
        'LIMIT = 3\n"""Whoever is told this."""',
        'class Told:\n    """Message."""',
        'def heard() -> None:\n    """Return the message."""',
        'raise ValueError(f"{path} is no regular file")',
        'click.echo("nobody answered, try again")',
    ],
)
def test_a_slip_is_found(source: str) -> None:
    assert list(code_slips("module.py", source, RULES))


@pytest.mark.parametrize(
    "source",
    [
        '"""Return the velocity to send, after arbitration, limits and ramp."""',
        'class Base:\n    """Base of a robot; ``told`` is a name here."""\n\n    def stop(self) -> None: ...',
        'raise ValueError(f"{path} is not a regular file")',
    ],
)
def test_a_plain_module_passes(source: str) -> None:
    assert list(code_slips("module.py", source, RULES)) == []


def test_a_class_name_used_twice_is_found() -> None:
    sources = {"a.py": "class Reader: ...", "b.py": "class Reader: ...", "c.py": "class _Reader: ..."}
    assert [slip.path for slip in class_doubles(sources)] == ["b.py"]


def test_long_lines_and_sentences_of_a_page_are_found() -> None:
    page = f"# Title\n\n{'word ' * 26}end.\n\n- {'item ' * 26}end.\n\n| {'cell ' * 40}|\n\n```\n{'code ' * 40}\n```\n"
    assert [slip.line for slip in page_slips("page.md", page)] == [3, 3, 5, 5]


def test_a_short_paragraph_over_several_lines_passes() -> None:
    page = "You start a mission.\nThe robot looks for a face.\n\n- It greets the person.\n- It stops.\n"
    assert list(page_slips("page.md", page)) == []
