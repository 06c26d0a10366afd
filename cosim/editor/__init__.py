"""What an editor shows of a diagram while it is written; a server that tells it."""
