"""Report of a recorded run on one page."""
