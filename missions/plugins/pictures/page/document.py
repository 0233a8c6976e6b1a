"""A whole page in one file: it carries its style, script and data, and its policy forbids it to ask any other host.

The report is made of the same parts as the page of a mission::

    body = join(tag("h1", "..."), tools(drawing), tree(drawing, label="Mission greet"), ...)
    document("Report of greet", body, data={"changes": ...}, assets=[REPORT / "report.css", REPORT / "report.js"])

``page.css`` and ``page.js`` always come first. What ``page.js`` offers to a script after it stands at its top.
"""

import base64
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from importlib.resources.abc import Traversable

# HTML as values: what is text is escaped, so nothing that a mission or a robot says can become markup.


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def join(*parts: str) -> Markup:
    """Return parts one after another; those that are no markup yet are escaped."""
    return Markup("".join(part if isinstance(part, Markup) else escape(part) for part in parts))


def tag(element: str, *content: str, **attributes: str | int | bool | None) -> Markup:
    """Return an element with its end tag: ``tag("b", name, class_="kind", data_key="1.2")``.

    Names of attributes lose a final underscore, and the others become hyphens. An attribute that is None or False is
    left out, one that is True stands without a value.
    """
    return Markup(f"{start_tag(element, **attributes)}{join(*content)}</{element}>")


def start_tag(element: str, **attributes: str | int | bool | None) -> Markup:
    """Return only the start tag: all there is of ``input`` and ``meta``."""
    written = (
        f" {name.rstrip('_').replace('_', '-')}" + ("" if value is True else f'="{escape(str(value))}"')
        for name, value in attributes.items()
        if value is not None and value is not False
    )
    return Markup(f"<{element}{''.join(written)}>")


PAGE_FOLDER = files(__name__.rpartition(".")[0])
"""The folder of ``page.css`` and ``page.js``."""

ICON = "data:,"
"""No icon. A page without one makes browsers ask for ``/favicon.ico``."""


def document(
    title: str, body: Markup, *, data: Mapping[str, object] | None = None, assets: Sequence[Traversable] = ()
) -> str:
    """Return the page. ``data`` is what its script finds as ``missiontree.data``: plain JSON.

    ``assets`` are more files to carry, styles (``.css``) and scripts (``.js``), in their order.

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
    """Return a page with the name of each asset in its place, ``{page.css}``: so it can be compared with a golden."""
    named = re.sub(r'(<(style|script) data-file="([^"]*)">).*?(</\2>)', r"\1{\3}\4", page, flags=re.DOTALL)
    return re.sub(r"sha256-[A-Za-z0-9+/=]+", "{hash}", named)


def _content_policy(scripts: Sequence[Traversable]) -> str:
    """Allow these very scripts, styles and pictures within the page, and nothing from anywhere."""
    hashes = (base64.b64encode(hashlib.sha256(_text(script).encode()).digest()).decode() for script in scripts)
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _inline_asset(element: str, asset: Traversable) -> Markup:
    """Return a style or script with its text as it is: HTML knows no escapes within them."""
    return tag(element, Markup(_text(asset)), data_file=asset.name)


def _text(asset: Traversable) -> str:
    return asset.read_text(encoding="utf-8")


def _json(data: Mapping[str, object]) -> Markup:
    """Return data for the script. Without a ``<`` in it, nothing can end the element; JSON has an escape for it."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return join(tag("script", Markup(text), type="application/json", id="data"))
