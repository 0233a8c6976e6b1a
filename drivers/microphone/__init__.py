"""Microphones: the sound card's, and a WAV file instead of one."""
