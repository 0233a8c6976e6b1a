"""The ``mission`` command, with one module for each subcommand."""
