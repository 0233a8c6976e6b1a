"""The command ``mission fleet``."""
