"""Understands what a body is: its joints' roles, limbs and trunk, T-pose, feet and contacts."""
