"""The commands of the task queue."""
