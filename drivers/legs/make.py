"""From the keys of a robot file to a base that walks."""

from drivers.api.driver import Site
from drivers.kobuki.steered import settings_of
from drivers.legs.body import body_of
from drivers.legs.declared import LegsKeys
from drivers.legs.engine import Engine
from drivers.legs.loop import WalkingBase


def make(keys: LegsKeys, site: Site) -> WalkingBase:
    """Return the driver; the arm whose joints it leads is opened and closed besides."""
    joints = site.parts["arm"]
    return WalkingBase(joints, site.clock, engine(keys), at_fall=keys.at_fall, **settings_of(keys, site))


def engine(keys: LegsKeys) -> Engine:
    """Return what walks. Raises BadRequest for strides that the legs cannot make."""
    return Engine(body_of(keys.body), keys.stride)
