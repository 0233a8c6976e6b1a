"""The commands that look into records."""
