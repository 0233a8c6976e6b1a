"""Fleets: robots that announce themselves over Zenoh, and the tasks that they share, without a broker or a leader."""
