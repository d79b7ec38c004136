"""Motions that teach: periodic motions within limits from which an arm is learned best."""
