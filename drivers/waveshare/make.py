"""From the keys of a robot file to the driver of a rover."""

from drivers.api.driver import Site
from drivers.base.arbitrated import settings_of
from drivers.transport.link import Link
from drivers.waveshare.declared import WaveshareKeys
from drivers.waveshare.driver import WaveshareBase


def make(keys: WaveshareKeys, site: Site) -> WaveshareBase:
    """Return the driver."""
    return WaveshareBase(
        Link("base", site.port, keys.baud, report=site.report),
        site.clock,
        track=keys.track,
        encoders=keys.encoders,
        speed_at_full=keys.speed_at_full,
        **settings_of(keys, site),
    )
