"""Puts motions on other bodies: canonical form, analytic transfer, foot lock, target prior."""
