"""Identification of chain, link and friction parameters from recordings."""
