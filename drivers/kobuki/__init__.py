"""The TurtleBot 2 base: iClebo Kobuki over its serial protocol."""
