"""Makes the demo motions by code: a walk, a wave and a squat, on two rigs."""
