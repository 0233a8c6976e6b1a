"""Missions from behaviour trees of other programs: XML of BehaviorTree.CPP, Nav2 and py_trees."""
