"""Constants of nature."""

GRAVITY = 9.81  # [m/s^2] at the Earth's surface, as MuJoCo has it by default
