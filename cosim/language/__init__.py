"""A YAML file becomes a diagram."""
