"""Writing and reading of records."""
