"""Control of a run from outside: the control socket, manual driving, and stops."""
