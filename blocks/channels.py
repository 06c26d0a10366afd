"""The units and names of a robot's three channels, x = [p_x, p_y, theta], (42)."""

POSITION = ("m", "m", "rad")
VELOCITY = ("m/s", "m/s", "rad/s")
ACCELERATION = ("m/s2", "m/s2", "rad/s2")
CHANNELS = ("x", "y", "heading")
