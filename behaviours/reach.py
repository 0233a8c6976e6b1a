"""The former name of ``behaviours.joint_ranges``, which goes with the next release."""

from typing import TYPE_CHECKING

from drivers.api.renamed import renamed

if not TYPE_CHECKING:
    _NAMES = {"JointRanges": "JointRanges", "Reach": "JointRanges", "degrees": "degrees"}
    __getattr__ = renamed(__name__, {name: f"behaviours.joint_ranges.{now}" for name, now in _NAMES.items()})
