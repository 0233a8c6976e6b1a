"""Recognition of the phrases that a mission listens for, and refusal of all other speech."""
