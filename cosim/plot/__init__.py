"""Pictures of results: figures that a study describes, a sensible default for any run, animations."""
