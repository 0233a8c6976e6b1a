"""Import of behaviour trees of other programs as missions: XML of BehaviorTree.CPP, Nav2, MoveIt Pro and py_trees."""
