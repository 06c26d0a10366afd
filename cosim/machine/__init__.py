"""What is asked of the computer: memory, object code, processes, the cache, interruption."""
