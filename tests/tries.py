"""How many moments of chance a test tries: a few in `make test`, as many as ``TRIES`` says in `make claims`."""

import os


def tries(usual: int) -> int:
    """Return how many moments are tried."""
    return int(os.environ.get("TRIES", str(usual)))
