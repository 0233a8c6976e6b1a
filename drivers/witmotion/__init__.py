"""WitMotion IMUs (JY901, WT901, BWT901), which report their attitude periodically."""
