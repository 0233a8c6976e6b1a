"""Mission tests: what a mission is to do, written beside it, played in simulated time and held against what it did."""
