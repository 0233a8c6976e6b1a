"""A node as the page shows it: a card with all that is known of it. To a screen reader that is the node's name.

Order and wording are for the ear as well: first what it is, then how it stands and why, then the rest. Signs are hidden
from screen readers; a word that only they need is "unseen".
"""

from collections.abc import Iterator

from missions.views.pictures.drawing import SIGNS, Badge, Box, Status
from missions.views.pictures.page.markup import Markup, join, tag


def card(box: Box, time: float | None = None) -> Markup:
    """Return the lines of a card. At a ``time`` it says how the node stands, and for how long."""
    return join(*_lines(box, time))


def _lines(box: Box, time: float | None) -> Iterator[Markup]:
    live = time is not None
    if box.case:
        yield tag("span", box.case if box.case == "else" else f"case {box.case}", class_="case")
    yield _title(box, live=live)
    if time is not None:
        yield _state(box.status, box.reason, "" if box.since is None else _age(box.status, time - box.since))
    for name, text in box.untold.items():
        yield _argument(name, text)
    if box.keep_as:
        yield _argument("as", box.keep_as)
    if box.badges:
        yield tag("span", *(_badge(badge, live=live) for badge in box.badges), class_="badges")
    if box.folded:
        yield tag("span", f"{box.folded} more inside", class_="argument")


def _argument(name: str, text: str) -> Markup:
    return tag("span", tag("i", name), " ", text, class_="argument")


def _title(box: Box, *, live: bool) -> Markup:
    kind, _, name = box.title.partition(": ")
    named = [tag("b", kind), f" {name}" if name else "", *(["\u00a0", _sign(box.status)] if live else [])]
    return tag(
        "span",
        tag("span", box.symbol, class_="symbol", aria_hidden="true"),
        tag("span", *named),
        " ",
        tag(
            "span",
            tag("span", box.file, class_="unseen"),
            f":{box.line}",
            class_="line",
            title=f"{box.file}:{box.line}",
        ),
        class_="title",
    )


def _age(status: Status, seconds: float) -> str:
    """Return for how long it has been running, or when that ended, as the script of a report writes it too."""
    return f"{seconds:.1f} s" if status in ("running", "suspended") else f"{seconds:.1f} s ago"


def _state(status: Status, reason: str, age: str) -> Markup:
    """Return how it stands: the word, for how long, and why, as ``showStates`` of the script writes them too."""
    return tag(
        "span",
        tag("span", status, class_="word"),
        tag("span", f" {age}" if age else "", class_="age"),
        tag("span", f" {reason}" if reason else "", class_="reason"),
        class_="state",
    )


def _sign(status: Status) -> Markup:
    return tag("span", SIGNS[status], class_="sign", aria_hidden="true")


def _badge(badge: Badge, *, live: bool) -> Markup:
    """Return a modifier. What it says for itself counts; as to all else it stands as what it modifies."""
    text = f"{badge.kind} {badge.text}".strip()
    if not live:
        return tag("span", text, class_="badge", title=f"line {badge.line}")
    state = _state(badge.status, badge.reason, "")
    return tag(
        "span", _sign(badge.status), " ", text, " ", state,
        class_="badge", data_key=badge.key, data_status=badge.status, title=f"line {badge.line}",
    )  # fmt: skip
