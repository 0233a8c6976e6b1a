"""Drawings of missions, worlds and runs."""
