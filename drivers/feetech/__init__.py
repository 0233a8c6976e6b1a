"""Arms of Feetech STS servos, as in the SO-101: the bus and the driver of ``drivers.dynamixel`` speak to them."""
