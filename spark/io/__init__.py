"""Motion files: read as they are written, turned into SI units and Z-up axes, and written."""
