"""Waveshare's rovers that exchange JSON over a serial line: WAVE ROVER, UGV Rover, UGV Beast and similar ones."""
