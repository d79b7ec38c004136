"""What the node serve does: check, answer, shape, watch."""
