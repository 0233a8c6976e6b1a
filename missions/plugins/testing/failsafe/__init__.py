"""Reaction of a base to faults, with reasons: the product's own classes, simulated step by step."""
