"""The devices at wire level on pseudo-terminals, so that the real drivers are what runs."""
