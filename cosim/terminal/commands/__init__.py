"""One file a command: `arguments(parser)` declares its options, `run(options)` does it and returns the exit code."""
