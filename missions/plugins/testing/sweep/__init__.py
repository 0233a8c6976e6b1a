"""Many runs of one mission over seeds and variations of its world: how often it succeeds, how fast, why it fails."""
