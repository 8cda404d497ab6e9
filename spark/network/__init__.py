"""Runs the SPARK network, on numpy alone: its features and forward pass."""
