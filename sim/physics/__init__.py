"""Motions tracked in simulation."""
