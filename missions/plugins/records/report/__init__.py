"""Report of a recorded run as one HTML page."""
