"""What the finder tells of one frame."""

from dataclasses import dataclass

from perception.api import Detection


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where a face is in one frame: ``found`` there by the detector, or else carried there by optical flow."""

    detection: Detection
    found: bool
