"""Virtual chain of servos at wire level, on a pseudo-terminal."""
