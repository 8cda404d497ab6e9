"""Spoilt files against every reader: `make fuzz`."""
