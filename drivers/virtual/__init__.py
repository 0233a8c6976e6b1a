"""Virtual devices at wire level on pseudo-terminals, for the real drivers."""
