"""Understanding the phrases that a mission listens for, and refusing all other speech."""
