"""From the keys of a robot file to the Kobuki's driver."""

from drivers.api.driver import Site
from drivers.base.arbitrated import settings_of
from drivers.kobuki.declared import KobukiKeys
from drivers.kobuki.driver import KobukiBase
from drivers.transport.link import Link


def make(keys: KobukiKeys, site: Site) -> KobukiBase:
    """Return the driver."""
    return KobukiBase(
        Link("base", site.port, keys.baud, report=site.report),
        site.clock,
        **settings_of(keys, site),
    )
