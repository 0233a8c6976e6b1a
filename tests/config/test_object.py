"""Objects to look for: phrases, and files that give them a name."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.colours import COLOURS
from config.diagnostics import InvalidFileError
from config.library import shipped_files
from config.object import FORMS, HUES, SHAPES, SIZES, load_object, read_phrase


@pytest.mark.parametrize(
    ("phrase", "colour", "shape", "size"),
    [
        ("red", "red", "thing", None),
        ("red ball", "red", "ball", None),
        ("big red box", "red", "box", 0.3),
        ("  Small  BLUE cube ", "blue", "box", 0.1),
        ("yellow round object", "yellow", "ball", None),
        ("pink round ball", "pink", "ball", None),
        ("green square thing", "green", "box", None),
        ("purple object", "purple", "thing", None),
    ],
)
def test_object_phrase_gives_size_colour_and_shape(phrase: str, colour: str, shape: str, size: float | None) -> None:
    found = read_phrase(phrase)
    assert (found.colour, found.shape, found.size) == (colour, shape, size)
    assert found.name == " ".join(phrase.lower().split())


@pytest.mark.parametrize(
    ("phrase", "said"),
    [
        ("", "which colour? such as 'red ball'"),
        ("big", "which colour?"),
        ("rad ball", "'rad' is not a colour; did you mean 'red'?"),
        ("bigg red ball", "'bigg' is not a colour; did you mean 'big'?"),
        ("red bal", "'bal' is not a shape; did you mean 'ball'?"),
        ("red ball big", "'big' is not a shape"),
        ("red round box", "is it a ball or a box?"),
        ("grey box", "grey things cannot be distinguished from a room; colours are: red, orange"),
        ("mauve box", "'mauve' is not a colour"),
    ],
)
def test_invalid_object_phrase_is_refused_with_a_hint(phrase: str, said: str) -> None:
    with pytest.raises(ValueError, match=said.replace("?", r"\?")):
        read_phrase(phrase)


@given(st.lists(st.sampled_from([*HUES, *SIZES, *FORMS, *SHAPES, "grey", "", "2"]), max_size=5).map(" ".join))
def test_every_row_of_words_is_read_or_refused(phrase: str) -> None:
    try:
        found = read_phrase(phrase)
    except ValueError as error:
        assert repr(phrase)[1:-1] in str(error)  # noqa: PT017 - either is right
    else:
        assert found.colour in phrase.split()
        assert read_phrase(found.name) == found


def test_object_colours_are_world_colours() -> None:
    assert set(HUES) < set(COLOURS)


@pytest.mark.parametrize("name", shipped_files("objects"))
def test_shipped_object_files_match_their_name(name: str) -> None:
    found = load_object(shipped_files("objects")[name])
    assert found.name == name
    assert found.summary
    assert found.size is not None


def test_all_object_file_faults_are_reported_together(tmp_path: Path) -> None:
    path = tmp_path / "cup.yaml"
    path.write_text("object: cup\ncolour: grey\nshape: cone\nsize: 9\nheight: 3 cm\n")
    with pytest.raises(InvalidFileError) as caught:
        load_object(path)
    assert [fault.mark.line for fault in caught.value.diagnostics] == [2, 3, 4, 5]


def test_a_file_may_leave_out_shape_and_size(tmp_path: Path) -> None:
    path = tmp_path / "cup.yaml"
    path.write_text("object: cup\ncolour: blue\n")
    found = load_object(path)
    assert (found.name, found.colour, found.shape, found.size) == ("cup", "blue", "thing", None)
