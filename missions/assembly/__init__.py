"""From a robot file to a robot: real drivers on real or virtual wires, and eyes to go with them."""
