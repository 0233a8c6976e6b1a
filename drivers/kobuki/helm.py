"""The former place of ``drivers.kobuki.velocity_multiplexer``."""

from typing import TYPE_CHECKING

from drivers.api.renamed import renamed

if not TYPE_CHECKING:
    __getattr__ = renamed(__name__, {"Helm": "drivers.kobuki.velocity_multiplexer.VelocityMultiplexer"})
