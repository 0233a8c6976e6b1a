"""Voices, languages and speeds: what a mission leaves open, the robot file says."""

from drivers.api import Manner

WORDS_PER_MINUTE = 150.0
"""How fast people talk, and synthesisers by default."""


def filled(manner: Manner, usual: Manner) -> Manner:
    """Return ``manner`` with what it leaves open taken from ``usual``.

    Of a usual voice such as "en-us+f2", only the variant "+f2" goes with another language, and "en-us" with another
    variant.
    """
    base, plus, variant = usual.voice.partition("+")
    voice = manner.voice or usual.voice
    if manner.language and not manner.voice:
        voice = plus + variant
    elif manner.voice.startswith("+") and not manner.language:
        voice = base + manner.voice
    return Manner(
        voice=voice,
        speed=manner.speed or usual.speed or WORDS_PER_MINUTE,
        language=manner.language or usual.language,
    )


def espeak_name(manner: Manner) -> str:
    """Return the voice as espeak calls it: "en-us+f2", or "" for its own choice; a variant goes with the language."""
    base, plus, variant = manner.voice.partition("+")
    base = base or manner.language
    return f"{base or 'en'}+{variant}" if plus else base


def seconds_of(text: str, speed: float) -> float:
    """Return how long a text takes to say, at so many words a minute."""
    return len(text.split()) * 60.0 / speed


def longest(text: str, manner: Manner) -> float:
    """Return after how many seconds a program that speaks a text, or makes sound of it, is taken to hang.

    0.4 s for each letter are five times what English takes, and enough for digits and for Chinese.
    """
    return 10.0 + 0.4 * len(text) * WORDS_PER_MINUTE / (manner.speed or WORDS_PER_MINUTE)
