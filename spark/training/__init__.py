"""The SPARK network's training, with torch: data, model, losses, checkpoints."""
