"""Controllers under test: how well they track in simulated time, how they look, and how they are tuned."""
