"""Parses the YAML of a mission into a checked plan, with each error at its file, line and column."""
