"""Commands that test missions and controllers in simulated time."""
