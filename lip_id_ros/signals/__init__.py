"""What comes over the graph, in the order of a model: references, joint states, filters."""
