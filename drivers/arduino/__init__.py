"""The Rodney head: pan and tilt servos on an Arduino that speaks rosserial."""
