"""Modules that write and read records of runs."""
