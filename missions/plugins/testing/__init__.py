"""Mission tests: cases in test files beside missions, run in simulated time and compared with their expectations."""
