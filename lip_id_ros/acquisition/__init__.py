"""What the node train does: record in sections, fit in processes."""
