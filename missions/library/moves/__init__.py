"""Movements of the joints: out of gesture files and spreadsheets, recorded, drawn, and how well they were followed."""
