"""Smileys in a text: what mood they set, and the text that is left to be spoken."""

import re

from drivers.api import Mood

TYPED = {
    Mood.HAPPY: r"[:;=]-?[)\]D]+",
    Mood.SAD: r"[:=]'?-?[(\[]+",
    Mood.SURPRISED: r"[:=]-?[Oo]",
}
EMOJI = {
    Mood.HAPPY: "\u263a\U0001f600-\U0001f60a\U0001f642\U0001f643\U0001f929\U0001f970",
    Mood.SAD: "\u2639\U0001f61e\U0001f61f\U0001f622\U0001f625\U0001f62d\U0001f641",
    Mood.SURPRISED: "\U0001f62e\U0001f62f\U0001f632\U0001f633",
    Mood.ASLEEP: "\U0001f62a\U0001f634\U0001f4a4",
}
"""The signs of each mood, as patterns and as sets of letters."""

SMILEY = re.compile(
    r"\s*(?:(?<![\w/])(?:"
    + "|".join(f"(?P<{mood.name}>{signs})" for mood, signs in TYPED.items())
    + r")(?!\w)|"
    + "|".join(f"(?P<{mood.name}_>[{signs}])\ufe0f?" for mood, signs in EMOJI.items())
    + ")"
)
"""One of them, with the space before it. In "at 8:00", "a list:[1]" and addresses there are none."""


def split(text: str) -> tuple[str, Mood | None]:
    """Return ``text`` without its smileys, and the mood of the last one; None where there is none."""
    found = list(SMILEY.finditer(text))
    if not found:
        return text, None
    return SMILEY.sub("", text).strip(), Mood[str(found[-1].lastgroup).rstrip("_")]
