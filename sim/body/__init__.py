"""MuJoCo bodies for rigs: masses, joints, shapes, servos, keyframes, MJCF."""
