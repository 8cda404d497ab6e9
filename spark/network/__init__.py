"""The SPARK network's inference, on numpy alone."""
