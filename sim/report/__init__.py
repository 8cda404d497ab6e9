"""The physical plausibility report."""
