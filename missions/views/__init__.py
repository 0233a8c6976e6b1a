"""Missions, worlds and runs as people see them: pictures, pages, text, and the live view on a terminal."""
