"""Motions from one body to another: canonical form, analytic transfer, foot lock, target prior."""
