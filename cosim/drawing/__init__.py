"""A network as a picture: boxes with ports, wires between them, in columns from left to right as signals go."""
