"""How much of a campaign a test tries: a share in `make test`, all of it in `make fuzz`, what TRIES says elsewhere."""

import os


def tries(usual: int, most: int | None = None) -> int:
    """Return ``usual``, as many as TRIES of the environment says, or ``most`` where it says "most"."""
    asked = os.environ.get("TRIES", "")
    if asked == "most":
        return most or usual
    return int(asked or usual)
