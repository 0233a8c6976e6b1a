"""From the keys of a robot file to a screen."""

from drivers.api import Mood, Screen
from drivers.api.driver import Site
from drivers.api.sections import ScreenKeys
from drivers.screen.declared import PageKeys
from drivers.screen.pages import PageScreen


def page(keys: PageKeys, site: Site) -> PageScreen:
    """Return a face on a page for a browser."""
    return PageScreen(site.clock, port=keys.port or 0, awake=Mood(keys.mood), report=site.report)


def printed(keys: ScreenKeys, site: Site) -> Screen:
    """Return a face that is told in words on the terminal."""
    from drivers.screen.printed import PrintedScreen  # noqa: PLC0415 - most robots have a page

    return PrintedScreen(site.clock, site.out, awake=Mood(keys.mood))
