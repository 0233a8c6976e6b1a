"""What every mobile base shares: arbitration, reflexes, limits, dead reckoning, and a base without sensors."""
