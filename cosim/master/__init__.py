"""The loop of the master algorithms, compiled or interpreted: it walks tables over memory, and knows no diagram."""
