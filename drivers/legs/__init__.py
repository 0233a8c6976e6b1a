"""Walking humanoids: body, kinematics, gaits, and a base on two legs."""
