"""What the measures are called: by name in code, JSON and tables, by label in text and plots."""

FLAGS = ("penetration", "floating", "skating", "root_wrench")
"""Any of these makes a frame implausible."""

LABELS = {
    "implausible": "implausible",
    "penetration": "penetration",
    "floating": "floating",
    "skating": "skating",
    "root_wrench": "root wrench",
    "joint_limit": "joint limits",
    "at_limit": "at a limit",
    "self_penetration": "self-penetration",
    "balance": "out of balance",
    "torque": "over torque",
    "missed_contact": "contacts missed",
    "invented_contact": "contacts invented",
    "swing_clearance": "swing clearance off",
    "pose": "pose",
    "tremble": "tremble",
    "root_drift": "root drift",
    "base_acceleration": "base acceleration",
    "limb_acceleration": "limb acceleration",
    "joint_speed": "joint speed",
    "joint_jerk": "joint jerk",
    "ground_truth_mse": "ground-truth MSE",
    "ground_truth_mpjpe": "ground-truth MPJPE",
}

UNITS = {
    **dict.fromkeys(LABELS, "%"),  # shares of frames, contacts or height
    "pose": "°",
    "tremble": "mm",
    "root_drift": "cm",
    "base_acceleration": "m/s²",
    "limb_acceleration": "x",  # times the source's
    "joint_speed": "rad/s",
    "joint_jerk": "rad/s³",
    "ground_truth_mse": "1e-4",
    "ground_truth_mpjpe": "% of height",
}
"""The unit of each measure in text and tables."""
