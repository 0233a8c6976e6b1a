"""What can be wrong with the files that perception reads. Imports nothing, so that every command can know it."""


class BadModel(ValueError):
    """A file that does not hold the network that it should: the message says which, and what to type next."""
