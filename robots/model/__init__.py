"""What a robot is: from any humanoid's MJCF to its morphology."""
