"""Trajectories become figures and files."""
