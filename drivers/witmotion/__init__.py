"""IMUs of WitMotion (JY901, WT901, BWT901): they tell their attitude unasked."""
