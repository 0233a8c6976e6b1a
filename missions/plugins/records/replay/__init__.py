"""Replay of recorded runs in a player, and reruns of their decisions and of perception."""
