"""A shelf of motions: many files onto many bodies, and what is worth keeping of them."""
