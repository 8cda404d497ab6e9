"""What the joints of a human are called, and how far they go."""

JOINTS: dict[str, str] = {
    "upper_leg": "hip",
    "lower_leg": "knee",
    "foot": "ankle",
    "upper_arm": "shoulder",
    "forearm": "elbow",
    "hand": "wrist",
}
"""The joint that turns each kind of body part, where it has a name of its own."""

# Half the opening [deg] of the one cone, about the T-pose, that a MuJoCo ball joint has. Generous:
# it also holds the twist; the report's own limits tell swing from twist.
CONES: dict[str, float] = {
    "pelvis": 60,
    "spine": 70,
    "neck": 80,
    "head": 80,
    "clavicle": 60,
    "shoulder": 170,
    "elbow": 165,
    "wrist": 140,
    "hip": 150,
    "knee": 165,
    "ankle": 90,
    "toe": 80,
    "link": 90,
}
