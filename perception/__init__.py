"""Perception: from camera frames to faces, things and markers with a direction and a time; and from sound to phrases."""

__project__ = "missiontree"
