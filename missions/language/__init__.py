"""Parses YAML into a checked plan, with each error at its file, line and column."""
