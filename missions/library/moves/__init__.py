"""Movements of joints: read from gesture files and spreadsheets, and recorded."""
