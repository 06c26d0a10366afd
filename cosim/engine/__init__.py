"""A network becomes trajectories."""
