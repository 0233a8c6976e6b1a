"""Assembly of a robot from its robot file: on hardware, on virtual devices, or from twins."""
