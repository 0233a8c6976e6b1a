"""A run in a file: written while it goes on, and read again."""
