"""What a body is: the roles of its joints, its limbs and trunk, T-pose, feet and their contacts."""
