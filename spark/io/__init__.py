"""Reads and writes motion files, and converts between their units and axes and SI, Z up."""
