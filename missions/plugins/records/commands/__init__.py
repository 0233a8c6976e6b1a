"""Subcommands of ``mission record``, which read recorded runs."""
