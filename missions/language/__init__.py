"""From YAML to a checked plan, with every fault at its file, line and column."""
