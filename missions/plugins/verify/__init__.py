"""Model checker for missions: explores all runs for all results of leaves, conditions and timings, up to a bound."""
