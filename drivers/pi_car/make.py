"""From the keys of a robot file to the drivers of a Raspberry Pi car; each has a guardian of its own."""

from collections.abc import Mapping
from typing import Any

from drivers.api.driver import Site
from drivers.arduino.make import axis
from drivers.base.steered import settings_of
from drivers.keeper import wire
from drivers.keeper.base import KeeperBase
from drivers.keeper.head import KeeperHead
from drivers.link import Link, dial
from drivers.pi_car.declared import MotorKeys, PiCarKeys, PiHeadKeys
from drivers.pi_car.dial import Guarded, cure


def base(keys: PiCarKeys, site: Site) -> KeeperBase:
    """Return the driver of the car."""
    dials = Guarded(wheels_of(keys))
    return KeeperBase(
        _link(dials, site),
        site.clock,
        track=keys.track,
        speed_at_full=keys.speed_at_full,
        why=lambda: dials.words,
        cure=cure(),
        **settings_of(keys, site),
    )


def head(keys: PiHeadKeys, site: Site) -> KeeperHead:
    """Return the driver of its pan/tilt."""
    told = {"bus": keys.bus, "address": keys.address, "pan": keys.pan.servo, "tilt": keys.tilt.servo}
    dials = Guarded(told)
    return KeeperHead(
        _link(dials, site),
        site.clock,
        pan=axis(keys.pan),
        tilt=axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        away=keys.away,
        report=site.report,
        name=site.part,
        why=lambda: dials.words,
        cure=cure(),
    )


def wheels_of(keys: PiCarKeys) -> Mapping[str, Any]:
    """Return what a guardian is told of the motors."""
    return {
        "motors": keys.motors,
        "bus": keys.bus,
        "address": keys.address,
        "left": _motor(keys.left),
        "right": _motor(keys.right),
    }


def _motor(keys: MotorKeys) -> Mapping[str, int | None]:
    return {"forward": keys.forward, "backward": keys.backward, "enable": keys.enable}


def _link(guarded: Guarded, site: Site) -> Link:
    """Return a link to a guardian, or to whoever plays it at a port."""
    port = site.port or "the guardian"
    return Link(site.part, port, wire.BAUD, report=site.report, dial=dial if site.port else guarded)
