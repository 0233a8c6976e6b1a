"""Waveshare rovers with JSON over a serial line: WAVE ROVER, UGV Rover, UGV Beast and similar ones."""
