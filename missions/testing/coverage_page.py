"""Coverage as one page of HTML that needs nothing beside it: every mission with its lines marked."""

from collections.abc import Iterable, Sequence
from html import escape

from missions.testing.coverage import FileCoverage, NodeCoverage

SIGNS = {"all": "✓", "part": "~", "nothing": "✗"}
"""A sign as well as a colour: not everybody tells red from green."""

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 62em; padding: 0 1em; color: #222; }
table { border-collapse: collapse; } td, th { padding: .2em 1em .2em 0; text-align: left; }
pre { border: 1px solid #ddd; padding: .5em 0; overflow-x: auto; line-height: 1.45; }
pre span { display: block; padding: 0 1em; }
pre b { display: inline-block; width: 5.5em; color: #777; font-weight: 400; }
.all { background: #e6f4e6; } .part { background: #fff4d6; } .nothing { background: #fbe0dd; }
i { color: #666; font-style: normal; }
"""


def page(files: Sequence[FileCoverage]) -> str:
    """Return the page."""
    rows = "\n".join(
        f'<tr><td><a href="#{number}">{escape(each.file)}</a></td><td>{each.ticked} of {len(each.nodes)}</td>'
        f"<td>{each.endings[0]} of {each.endings[1]}</td></tr>"
        for number, each in enumerate(files)
    )
    parts = "\n".join(_file(number, each) for number, each in enumerate(files))
    key = "".join(
        f'<span class="{kind}"> {SIGNS[kind]} {words} </span> '
        for kind, words in (("all", "all tried"), ("part", "reached, not tried in full"), ("nothing", "never reached"))
    )
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>What the tests have tried</title>'
        f"<style>{STYLE}</style></head><body>\n<h1>What the tests have tried</h1>\n<p>{key}</p>\n"
        f"<table><tr><th>mission</th><th>nodes ticked</th><th>endings seen</th></tr>\n{rows}\n</table>\n{parts}\n"
        "</body></html>\n"
    )


def _file(number: int, each: FileCoverage) -> str:
    by_line: dict[int, list[NodeCoverage]] = {}
    for node in each.nodes:
        by_line.setdefault(node.line, []).append(node)
    text = each.text()
    if text is None:
        return f'<h2 id="{number}">{escape(each.file)}</h2>\n<p>This file cannot be read any more.</p>'
    lines = "".join(_line(place, line, by_line.get(place, [])) for place, line in enumerate(text.splitlines(), start=1))
    return f'<h2 id="{number}">{escape(each.file)}</h2>\n<pre>{lines}</pre>'


def _line(number: int, text: str, nodes: Iterable[NodeCoverage]) -> str:
    """Return one line of a mission: marked by the least tried of its nodes, with what is missing behind it."""
    here = list(nodes)
    if not here:
        return f"<span><b>{number}</b>{escape(text)}</span>"
    order = ("nothing", "part", "all")
    tried = min((node.tried for node in here), key=order.index)
    lacks = "; ".join(f"{node.kind} {node.lacks()}" for node in here if node.lacks())
    reasons = "; ".join(reason for node in here for reason in node.reasons)
    title = f' title="{escape(reasons, quote=True)}"' if reasons else ""
    note = f"  <i># {escape(lacks)}</i>" if lacks else ""
    return f'<span class="{tried}"{title}><b>{number} {SIGNS[tried]}</b>{escape(text)}{note}</span>'
