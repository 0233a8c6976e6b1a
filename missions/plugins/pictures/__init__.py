"""Pictures for people: of missions, of worlds, of runs."""
