"""Trees of missions as data and as text."""
