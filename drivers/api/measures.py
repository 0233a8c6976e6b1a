"""The dimensions of what a robot measures, as annotations: a mission cannot add a length to an angle.

A value stays a float in SI units; expressions read of its class what it measures.
"""

from typing import Annotated

Angle = Annotated[float, "angle"]
"""Radians."""

Length = Annotated[float, "length"]
"""Metres."""

Duration = Annotated[float, "duration"]
"""Seconds."""
