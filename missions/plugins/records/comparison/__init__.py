"""Two runs of one mission, side by side."""
