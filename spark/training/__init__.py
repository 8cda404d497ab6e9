"""Trains the SPARK network, with torch: data, model, losses, checkpoints."""
