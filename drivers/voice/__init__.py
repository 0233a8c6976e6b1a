"""Voices: speech by a synthesiser if one is installed, else printed text."""
