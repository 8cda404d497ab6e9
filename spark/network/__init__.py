"""Runs the SPARK network, on numpy alone: its features, forward pass and weights."""
