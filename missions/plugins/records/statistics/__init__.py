"""Statistics of recorded runs: counts, durations, delays."""
