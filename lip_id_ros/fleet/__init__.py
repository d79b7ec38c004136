"""A fit to a fleet of recordings: a map over recordings and a sum (docs/maths.md, section 14)."""
