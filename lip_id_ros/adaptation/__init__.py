"""A fitted arm that follows what changes: a recursive filter over links and friction."""
