"""How thick a human's flesh is around the joints of a rig."""

# Half the thickness of the flesh around a joint's bones, as fractions of the standing height.
RADII: dict[str, float] = {
    "pelvis": 0.055,
    "spine": 0.055,
    "neck": 0.030,
    "head": 0.045,
    "clavicle": 0.030,
    "upper_arm": 0.026,
    "forearm": 0.021,
    "hand": 0.016,
    "upper_leg": 0.043,
    "lower_leg": 0.031,
    "foot": 0.020,
    "toe": 0.016,
}
