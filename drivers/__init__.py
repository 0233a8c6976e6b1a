"""How the robot moves, speaks and gets its pictures: thin drivers behind the protocols of ``drivers.api``."""

__project__ = "missiontree"
