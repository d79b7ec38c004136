"""How the package is used, run in a checkout."""
