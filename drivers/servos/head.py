"""The former place of ``drivers.head.joints_head.NeckDriver``."""

from typing import TYPE_CHECKING

from drivers.api.renamed import renamed

if not TYPE_CHECKING:
    __getattr__ = renamed(__name__, {"DynamixelHead": "drivers.head.joints_head.NeckDriver"})
