"""The HTML itself, without a browser: whatever is said stays text, and a page carries all that it needs."""

import json
import re
from html.parser import HTMLParser
from importlib.resources.abc import Traversable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from missions.plugins.pictures.compare import compare
from missions.plugins.pictures.page.document import PAGE_FOLDER, Markup, document, join, start_tag, tag, without_assets
from missions.plugins.pictures.page.pair import page, pair_page
from missions.trees.drawing import TreeDrawing
from tests.cases import each
from tests.missions.views.pictures.drawn import DRAWINGS, HOSTILE


class Reader(HTMLParser):
    """Reads a page back: its tags, its ids, and the text outside of styles and scripts."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def values(text: str, name: str) -> list[str | None]:
    """Return what an attribute is at each tag that has it."""
    return [attributes[name] for _, attributes in Reader(text).tags if name in attributes]


@given(st.text(alphabet=st.characters(codec="utf-8", exclude_characters="\r\0")))
def test_text_and_attributes_round_trip(text: str) -> None:
    read = Reader(tag("b", text, title=text))
    assert "".join(read.texts) == text
    assert read.tags == [("b", {"title": text})]


def test_markup_is_not_escaped_twice() -> None:
    assert join(tag("b", "<"), " & ") == "<b>&lt;</b> &amp; "
    assert start_tag("input", hidden=True, name=None, disabled=False, data_key="1.2") == '<input hidden data-key="1.2">'


def test_page_embeds_style_and_script_and_has_no_external_links() -> None:
    text = document("A title", tag("h1", "Hello"))
    assert PAGE_FOLDER.joinpath("page.css").read_text() in text
    assert PAGE_FOLDER.joinpath("page.js").read_text() in text
    assert values(text, "src") == []
    assert values(text, "href") == ["data:,"]
    assert not re.search(r"https?://|@import|url\(", text)


def test_the_policy_names_the_hash_of_every_script_and_allows_no_other(tmp_path: Path) -> None:
    script: Traversable = tmp_path / "report.js"
    (tmp_path / "report.js").write_text("missiontree.showNode('1');")
    policy = values(document("A title", Markup(""), assets=[script]), "content")[0]
    assert policy is not None
    assert policy.startswith("default-src 'none';")
    assert len(re.findall(r"'sha256-[\w+/]{43}='", policy)) == 2


def test_additional_assets_follow_those_of_the_page(tmp_path: Path) -> None:
    for name in ("report.js", "report.css"):
        (tmp_path / name).write_text(f"/* {name} */")
    text = document("A title", Markup(""), assets=[tmp_path / "report.js", tmp_path / "report.css"])
    assert values(text, "data-file") == ["page.css", "report.css", "page.js", "report.js"]


def test_golden_page_has_asset_names_as_placeholders() -> None:
    golden = without_assets(document("A title", tag("h1", "Hello")))
    assert golden.count("{page.css}") == golden.count("{page.js}") == 1
    assert "{hash}" in golden
    assert len(golden) < 1000


@each("text", [HOSTILE, "</script><script>alert(1)</script>", "<!--<script>", "\u2028"])
def test_embedded_data_cannot_close_its_element(text: str) -> None:
    read = Reader(document("A title", Markup(""), data={text: [text]}))
    assert [attributes.get("id") for tag, attributes in read.tags if tag == "script"] == ["data", None]
    (data,) = (text for text in read.texts if text.startswith('{"'))
    assert json.loads(data) == {text: [text]}


def test_data_with_nan_is_refused() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        document("A title", Markup(""), data={"x": float("nan")})


@settings(max_examples=30)
@given(DRAWINGS)
def test_any_drawing_becomes_a_page_of_expected_elements(drawing: TreeDrawing) -> None:
    text = page(drawing)
    read = Reader(text)
    boxes = list(drawing.root.walk())
    assert values(text, "role").count("treeitem") == len(boxes)
    assert len(set(values(text, "id"))) == len(values(text, "id"))
    assert not {tag for tag, _ in read.tags} & {"img", "iframe", "object", "a"}
    assert sum(tag == "script" for tag, _ in read.tags) == 1


@settings(max_examples=30)
@given(DRAWINGS, DRAWINGS)
def test_any_pair_of_drawings_becomes_a_page(left: TreeDrawing, right: TreeDrawing) -> None:
    comparison = compare(left, right)
    text = pair_page(comparison)
    assert values(text, "data-change") == [pair.change for pair in comparison.root.walk()]
    assert len(set(values(text, "id"))) == len(values(text, "id"))
