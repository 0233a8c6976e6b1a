"""From the keys of a robot file to the RPLIDAR's driver."""

from drivers.api.driver import Site
from drivers.rplidar.declared import RPLidarKeys
from drivers.rplidar.driver import GATHER, RPLidar
from drivers.transport.link import Link


def make(keys: RPLidarKeys, site: Site) -> RPLidar:
    """Return the driver."""
    link = Link("range", site.port, keys.baud, gather=GATHER, report=site.report)
    return RPLidar(link, site.clock, model=keys.model, place=keys.place, blind=keys.blind, report=site.report)
