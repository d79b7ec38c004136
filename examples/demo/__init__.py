"""A simulated Panda, recorded, learned, served and judged: `make demo`."""
