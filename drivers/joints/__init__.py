"""Shared code of named joints, for any bus or topic."""
