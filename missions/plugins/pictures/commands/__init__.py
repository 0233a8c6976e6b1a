"""The command that draws a simulated world."""
