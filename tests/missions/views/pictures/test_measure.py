"""Widths of texts: at least what the font takes, so that nothing sticks out of its card."""

from pathlib import Path
from unicodedata import category

from hypothesis import given
from hypothesis import strategies as st
from matplotlib import get_data_path
from matplotlib.ft2font import FT2Font, LoadFlags

from missions.language.nodes import COMPOSITES, IN_TURN_SELECTOR, OTHER_PARENTS
from missions.plugins.pictures.layout import text_width, truncate, wrap_items
from tests.cases import each

FONTS = {
    bold: FT2Font(str(Path(get_data_path()) / "fonts" / "ttf" / name))
    for bold, name in ((False, "DejaVuSans.ttf"), (True, "DejaVuSans-Bold.ttf"))
}


def taken(text: str, *, bold: bool) -> float:
    """The width of a text in the font itself, for a size of 1."""
    font = FONTS[bold]
    glyphs = (font.load_char(ord(letter), flags=LoadFlags.NO_SCALE) for letter in text)
    return sum(glyph.horiAdvance for glyph in glyphs) / font.units_per_EM


@each("bold", [False, True])
def test_width_table_matches_the_font(bold: bool) -> None:
    for letter in map(chr, range(32, 127)):
        assert taken(letter, bold=bold) <= text_width(letter, 1.0, bold=bold) < taken(letter, bold=bold) + 0.001, letter


@each("bold", [False, True])
def test_the_signs_of_our_pictures_have_room(bold: bool) -> None:
    for text in (*"○▶✓✗→⇉¹↻⇄▣◇■≠…°·äßéñøΩ", "Здравствуйте, как дела", "Καλημέρα σας"):
        assert taken(text, bold=bold) <= text_width(text, 1.0, bold=bold), text


def test_the_font_of_pictures_has_the_symbol_of_every_node() -> None:
    kinds = (*COMPOSITES.values(), *OTHER_PARENTS.values(), IN_TURN_SELECTOR)
    missing = {sign for kind in kinds for sign in kind.symbol if not FONTS[False].get_char_index(ord(sign))}
    assert not missing


@each("bold", [False, True])
def test_no_letter_of_latin_greek_or_russian_takes_more_than_is_reckoned(bold: bool) -> None:
    blocks = (range(0xA0, 0x250), range(0x370, 0x400), range(0x400, 0x460))
    letters = [chr(number) for block in blocks for number in block if FONTS[bold].get_char_index(number)]
    found = {letter: (taken(letter, bold=bold), text_width(letter, 1.0, bold=bold)) for letter in letters}
    assert not {each: both for each, both in found.items() if both[0] > both[1] + 0.003 and category(each) != "Cf"}


def test_wide_and_zero_width_characters_are_measured() -> None:
    assert text_width("日本", 10) >= 20
    assert text_width("e\u0301", 10) == text_width("e", 10)


@given(st.text(), st.floats(20, 400))
def test_truncated_text_fits_and_ends_in_an_ellipsis(text: str, most: float) -> None:
    shown = truncate(text, 11, most)
    whole = " ".join(text.split())
    assert text_width(shown, 11) <= most
    assert shown == whole or (shown.endswith("…") and whole.startswith(shown[:-1].rstrip()))


@given(st.lists(st.text(min_size=1)), st.floats(30, 400), st.integers(1, 4))
def test_wrapped_items_fill_the_given_lines_at_most(items: list[str], most: float, lines: int) -> None:
    rows = wrap_items(items, ", ", 11, most, lines)
    assert len(rows) <= lines
    assert all(text_width(row, 11) <= most for row in rows)


def test_items_stay_in_one_piece_and_a_long_one_is_broken_between_words() -> None:
    assert wrap_items(["pan: [-60 deg, 60 deg]", "scans: 1"], ", ", 11, 150, 3) == (
        "pan: [-60 deg, 60 deg]",
        "scans: 1",
    )
    assert wrap_items(["pan: 1", "scans: 1"], ", ", 11, 150, 3) == ("pan: 1, scans: 1",)
    long = wrap_items(["text: so much to say that it takes two lines"], ", ", 11, 150, 3)
    assert " ".join(long) == "text: so much to say that it takes two lines"
    assert wrap_items(["one", "two", "three"], ", ", 11, 50, 1)[0].endswith("…")
