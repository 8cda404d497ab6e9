"""MuJoCo bodies for skeletons, playback of motions on them, and the plausibility report."""

DISTRIBUTION = "spark-sim"
