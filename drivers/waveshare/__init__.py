"""The rovers of Waveshare that speak JSON over a serial line: WAVE ROVER, UGV Rover, UGV Beast and their like."""
