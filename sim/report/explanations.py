"""What each measure means, and what causes it: a sentence or two, for people who meet it first."""

MEANINGS = {
    "penetration": "Part of the body is more than 1 cm under the floor. Feet sink where legs are "
    "longer or more bent than the source's, or where the floor was put at the wrong height.",
    "floating": "Nothing touches the floor, and yet the body does not fall. It comes from a root "
    "that is scaled too high, legs that are too short, or a floor that is too low.",
    "skating": "A foot that carries weight slides. It comes from legs of other proportions, a root "
    "whose path doesn't fit the steps, or feet that nothing holds where they stand.",
    "root_wrench": "The motion needs a force or a turn that the floor can't give, as if a hand "
    "held the body. It comes from a base that jumps or leans, or from feet that are away when "
    "they are needed.",
    "joint_limit": "A joint is bent further than it can be. It comes from a wrong T-pose or joint "
    "axis, or from a target with less range than the source.",
    "at_limit": "A joint rests on the end of its range. The motion asks for more than the body can "
    "do there, and what is missing shows elsewhere.",
    "self_penetration": "Parts of the body are in each other beyond what they are in the source. "
    "Arms that were copied onto a broader body go through it.",
    "balance": "The body stands still beside its feet, and would tip. It comes from a lean that "
    "masses of another distribution can't hold, or from a foot in the wrong place.",
    "torque": "A joint needs more torque than its motor gives, even with forces of the floor "
    "that spare the motors. It comes from fast or jerky moves, deep bends, or a weak motor.",
    "contacts": "Whether the feet stand when the source's stand (1 is always). Differences come "
    "from feet that are lifted late, put down early, or brush the floor in swing.",
    "swing_clearance": "How high the feet pass over the floor in swing, where 1 is as high as the "
    "source's for the body's size. Feet that are pressed down to the floor stumble; feet that are "
    "lifted too high stamp.",
    "pose": "By what angles limbs, trunk, feet, head and hands point away from the source's. It "
    "comes from joints that can't reach, limbs that are in each other's way, a wrong T-pose, or a "
    "body that stands still while its source moves.",
    "tremble": "How far the base or a limb's end goes to and fro from frame to frame, in the worst "
    "half second. Accelerations and torques are means over 0.1 s, and don't show it. It comes from "
    "corrections that undo each other, or from noise that is copied.",
    "root_drift": "How far the body strays from the source's path, scaled to its size. It comes "
    "from steps that slide, or from a root that is scaled by other lengths than the legs.",
    "base_acceleration": "How hard the hips are thrown about, in all but the worst 1 % of the "
    "frames. A base that gives way where feet or limits are repaired frame by frame has more than "
    "its source.",
    "limb_acceleration": "How hard hands, elbows, feet and head are thrown about, in all but the "
    "worst 1 % of the frames, where 1 is as hard as the source's for the body's size. Arms that "
    "flip between two ways to reach a pose, or are pushed out of the body, have more.",
    "joint_speed": "The fastest joint. One that is much faster than the source's flips: its angles "
    "jump, or a limb is stretched out and turns over.",
    "joint_jerk": "How unevenly joints speed up. Noise of the recording, and corrections from "
    "frame to frame, raise it.",
    "ground_truth": "How far the joints are from where they should be, where the right answer is "
    "known.",
}
"""By the names of `sim.report.names`; of what is told in one card under one name."""
