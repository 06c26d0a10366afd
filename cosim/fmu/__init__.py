"""Functional Mock-up Units: exporting blocks as native ones, and running those of others."""
