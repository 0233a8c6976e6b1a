"""Following a face: the fuzzy controller and the behaviour around it."""
