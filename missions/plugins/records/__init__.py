"""Recording, replay, reports and statistics of runs."""
