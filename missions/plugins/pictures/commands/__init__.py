"""Command that draws a simulated world."""
