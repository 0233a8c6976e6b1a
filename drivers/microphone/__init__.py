"""Microphones: the sound card's, and a file that stands in for one."""
