"""Demo motions made by code: a walk, a wave and a squat on two rigs."""
