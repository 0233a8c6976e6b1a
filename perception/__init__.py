"""Perception: from camera frames to faces, things and markers with direction and time; and from sound to phrases."""

__project__ = "missiontree"
