"""What the robot can do: the leaves of a mission, a module for each part of the robot."""

import sys

from behaviours.lazy_imports import LAZY_MODULES, LazyModuleFinder

__project__ = "missiontree"

sys.meta_path.insert(0, LazyModuleFinder(LAZY_MODULES))
