"""Leaves of missions: the actions and conditions of the robot, in a module per part."""

import sys

from behaviours.lazy_imports import LAZY_MODULES, LazyModuleFinder

__project__ = "missiontree"

sys.meta_path.insert(0, LazyModuleFinder(LAZY_MODULES))
