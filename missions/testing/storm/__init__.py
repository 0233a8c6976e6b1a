"""A storm: random missions in random worlds on random robots, with faults by seed, and what must hold all the same."""
