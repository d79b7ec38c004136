"""Robot descriptions: a URDF as it is read, and what is written back into it."""
