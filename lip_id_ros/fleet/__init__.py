"""A fit to a fleet of recordings: a map over recordings and a sum (maths.md, section 14)."""
