"""Robots that follow a source frame by frame."""
