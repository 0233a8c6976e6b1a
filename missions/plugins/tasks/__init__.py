"""Tasks: missions that wait to be run, in a queue that outlives crashes, and the notices of their results."""
