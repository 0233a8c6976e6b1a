"""Speech and sounds, shared by several devices: synthesis, playback, WAV files, and printed speech."""
