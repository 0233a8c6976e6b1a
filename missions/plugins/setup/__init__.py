"""Setup commands: find devices, write robot files, calibrate, enrol people."""
