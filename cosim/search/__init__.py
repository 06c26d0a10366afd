"""Searches over runs: for what violates a requirement, and for gains that are better."""
