"""From the keys of a robot file to a screen."""

from drivers.api import Mood
from drivers.api.driver import Site
from drivers.api.sections import ScreenKeys
from drivers.screen.declared import PageKeys
from drivers.screen.pages import PageScreen
from drivers.screen.printed import PrintedScreen


def page(keys: PageKeys, site: Site) -> PageScreen:
    """Return a face on a page for a browser."""
    return PageScreen(site.clock, port=keys.port or 0, awake=Mood(keys.mood), report=site.report)


def printed(keys: ScreenKeys, site: Site) -> PrintedScreen:
    """Return a face that is told in words on the terminal."""
    return PrintedScreen(site.clock, site.out, awake=Mood(keys.mood))
