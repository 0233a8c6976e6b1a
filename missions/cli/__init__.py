"""The ``mission`` command, one module a subcommand."""
