"""Reader of robot files, worlds, gestures, controllers and other files."""

__project__ = "missiontree"
