"""Replay of recorded runs: player, rerun of decisions, rerun of perception."""
