"""Device drivers behind the protocols of ``drivers.api``: bases, heads, arms, sensors, voices and screens."""

__project__ = "missiontree"
