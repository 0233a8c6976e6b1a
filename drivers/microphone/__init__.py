"""Microphones: that of the sound card, or a WAV file in its place."""
