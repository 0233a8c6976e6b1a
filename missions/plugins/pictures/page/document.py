"""HTML page in one file, with style, script and data inside; its security policy blocks all network access.

A page is composed of parts::

    body = join(tag("h1", "..."), tools(drawing), tree(drawing, label="Mission greet"), ...)
    document("Report of greet", body, data={"changes": ...}, assets=[REPORT / "report.css", REPORT / "report.js"])

``page.css`` and ``page.js`` always come first. The top of ``page.js`` lists its functions for later scripts.
"""

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from importlib.resources.abc import Traversable

# HTML as values: text is escaped, so no text of a mission or a robot can become markup.


class Markup(str):
    """Text that is already HTML."""

    __slots__ = ()


def join(*parts: str) -> Markup:
    """Return the concatenated parts; parts that are not markup are escaped."""
    return Markup("".join(part if isinstance(part, Markup) else escape(part) for part in parts))


def tag(element: str, *content: str, **attributes: str | int | bool | None) -> Markup:
    """Return an element with its end tag: ``tag("b", name, class_="kind", data_key="1.2")``.

    Attribute names lose a final underscore; other underscores become hyphens. None or False omits an attribute, True
    writes it without a value.
    """
    return Markup(f"{start_tag(element, **attributes)}{join(*content)}</{element}>")


def start_tag(element: str, **attributes: str | int | bool | None) -> Markup:
    """Return only the start tag, for void elements such as ``input`` and ``meta``."""
    written = (
        f" {name.rstrip('_').replace('_', '-')}" + ("" if value is True else f'="{escape(str(value))}"')
        for name, value in attributes.items()
        if value is not None and value is not False
    )
    return Markup(f"<{element}{''.join(written)}>")


PAGE_FOLDER = files(__name__.rpartition(".")[0])
"""Folder of ``page.css`` and ``page.js``."""

ICON = "data:,"
"""Empty icon, so that browsers do not request ``/favicon.ico``."""


def document(
    title: str, body: Markup, *, data: Mapping[str, object] | None = None, assets: Sequence[Traversable] = ()
) -> str:
    """Return an HTML page. Its script finds ``data`` as ``missiontree.data``: plain JSON.

    ``assets`` are further styles (``.css``) and scripts (``.js``), in order.

    Raises:
        ValueError: ``data`` holds a number that JSON does not have, infinite or not a number.
    """
    carried = [PAGE_FOLDER / "page.css", PAGE_FOLDER / "page.js", *assets]
    styles = [asset for asset in carried if asset.name.endswith(".css")]
    scripts = [asset for asset in carried if asset.name.endswith(".js")]
    head = tag(
        "head",
        start_tag("meta", charset="utf-8"),
        start_tag("meta", http_equiv="Content-Security-Policy", content=_content_policy(scripts)),
        start_tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        start_tag("meta", name="color-scheme", content="light dark"),
        start_tag("link", rel="icon", href=ICON),
        tag("title", title),
        *(_inline_asset("style", asset) for asset in styles),
    )
    ending = [_json(data)] if data is not None else []
    ending += [_inline_asset("script", asset) for asset in scripts]
    return f"<!doctype html>\n{tag('html', head, tag('body', tag('main', body), *ending), lang='en')}\n"


def without_assets(page: str) -> str:
    """Return a page with each asset replaced by its name, ``{page.css}``, to compare it with a golden file."""
    named = re.sub(r'(<(style|script) data-file="([^"]*)">).*?(</\2>)', r"\1{\3}\4", page, flags=re.DOTALL)
    return re.sub(r"sha256-[A-Za-z0-9+/=]+", "{hash}", named)


def _content_policy(scripts: Sequence[Traversable]) -> str:
    """Return the content security policy: only these scripts, and inline styles and pictures; no other sources."""
    hashes = (base64.b64encode(hashlib.sha256(_text(script).encode()).digest()).decode() for script in scripts)
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _inline_asset(element: str, asset: Traversable) -> Markup:
    """Return a style or script element with unescaped text: HTML has no escapes inside them."""
    return tag(element, Markup(_text(asset)), data_file=asset.name)


def _text(asset: Traversable) -> str:
    return asset.read_text(encoding="utf-8")


def _json(data: Mapping[str, object]) -> Markup:
    """Return data as JSON for a script element, with each ``<`` escaped, so that a text cannot end the element."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return join(tag("script", Markup(text), type="application/json", id="data"))
