"""Which missions, robots, worlds, leaves and drivers there are, and where they are found."""
