"""Friction of drives: terms of the literature, and the model that is made of them."""
