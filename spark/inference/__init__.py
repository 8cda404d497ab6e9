"""What networks run on without torch: weights from a file, layers on arrays, the name encoder."""
