"""Driver declarations of screens: a page for a browser, and lines on the terminal."""

from drivers.api.driver import Driver
from drivers.api.keys import key, keys
from drivers.api.sections import ScreenKeys


@keys
class PageKeys(ScreenKeys):
    """Keys of a screen that is a page for a browser."""

    port: int | None = key(
        default=None,
        low=1024,
        high=65535,
        help="Port of the page, on this computer only; by default a free one.",
    )


PAGE = Driver(
    "page",
    "screen",
    "A page for a browser.",
    PageKeys,
    make="drivers.screen.make:page",
)
PRINT = Driver(
    "print",
    "screen",
    "A line on the terminal.",
    PageKeys,
    make="drivers.screen.make:printed",
)
