"""A run → what its time goes to."""
