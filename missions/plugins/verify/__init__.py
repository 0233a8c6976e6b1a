"""A model checker for missions: every run that leaves, conditions and time can lead to, up to a bound."""
