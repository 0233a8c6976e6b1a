"""What a camera sees, live, as a page for a browser."""
