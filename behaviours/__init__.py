"""What the robot can do: the leaves of a mission, a module for each part of the robot."""

import sys

from behaviours.deferred import DEFERRED, DeferredFinder

__project__ = "missiontree"

sys.meta_path.insert(0, DeferredFinder(DEFERRED))
