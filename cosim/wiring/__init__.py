"""A diagram becomes a network."""
