"""Whether a picture shows anything: not black, not white, not all of one colour."""

from drivers.api import Image

DARK, BRIGHT = 12.0, 243.0
"""The mean of 255 grey levels below which a picture is black, and above which it is white."""

FLAT = 2.0
"""Grey levels by which a picture of anything differs from its mean, at the least."""


def unusable(image: Image) -> tuple[str, str] | None:
    """Say what is wrong with a picture, and what to try; None for one that shows something."""
    mean, spread = float(image.mean()), float(image.std())
    told = f"its mean is {mean:.0f} of 255"
    if mean < DARK:
        return f"the picture is black ({told})", "take the cap or the shutter off the lens, make light, then try again"
    if mean > BRIGHT:
        return f"the picture is white ({told})", "turn it away from the lamp or window"
    if spread < FLAT:
        return (
            f"the picture is all of one colour ({told})",
            "look whether something covers the lens; try another source",
        )
    return None
