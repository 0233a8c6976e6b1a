"""From the keys of a robot file to the Kobuki's driver."""

from drivers.api.driver import Site
from drivers.kobuki.declared import KobukiKeys
from drivers.kobuki.driver import KobukiBase
from drivers.link import Link


def make(keys: KobukiKeys, site: Site) -> KobukiBase:
    """Return the driver."""
    return KobukiBase(
        Link("base", site.port, keys.baud, report=site.report),
        site.clock,
        max_linear=keys.max_speed,
        max_angular=keys.max_turn,
        linear_acceleration=keys.acceleration,
        angular_acceleration=keys.turn_acceleration,
        reflexes=keys.reflexes,
        away=keys.away,
        report=site.report,
        changed=site.changed,
        steered=site.steered,
    )
