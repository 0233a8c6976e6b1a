"""Driver of the Rodney head: pan and tilt servos on an Arduino with rosserial."""
