"""How a run is watched and stopped from outside: the stop latch and the control socket."""
