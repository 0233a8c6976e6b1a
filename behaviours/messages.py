"""What a leaf raised or gave, in words: whatever that is, and whatever it does when it is asked for them."""


def error_text(error: BaseException) -> str:
    """Return an exception's type and words; the type alone where it has none, or cannot say them."""
    words = message_of(error)
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def message_of(error: BaseException) -> str:
    """Return an exception's words; none where it cannot say them, which may raise whatever there is."""
    try:
        return str(error)
    except BaseException:  # as in Leaf.on_tick
        return ""


def shown(value: object) -> str:
    """Return what a leaf gave, whatever that is, for a message."""
    try:
        return repr(value)[:80]
    except BaseException:  # as in message_of
        return f"a {type(value).__name__}"
