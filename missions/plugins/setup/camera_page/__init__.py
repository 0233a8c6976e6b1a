"""Live camera page for a browser."""
