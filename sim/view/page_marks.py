"""What a page draws over a figure: contacts, centre of mass, joints at a limit, flags, findings."""

from typing import Any

import numpy as np
from jaxtyping import Float

from sim.view.annotations import Annotations
from sim.view.packing import in_base64, packed
from sim.view.scene import Placement, Scene
from spark.runs import true_runs


def page_marks(known: Annotations, placement: Placement, scene: Scene) -> dict[str, Any]:
    """What is known of a figure's motion, in the scene's own frames, which may be fewer: what lasts
    for one frame of the motion is not lost. Points are the scene's; times are in seconds."""
    count, last = len(scene.qpos), len(known.com) - 1
    times = np.arange(count) * scene.frame_time
    frames = np.minimum(np.round(times / known.frame_time).astype(int), last)
    own = np.arange(last + 1)
    nearest = np.round(own * known.frame_time / scene.frame_time).astype(int)
    nearest = np.minimum(nearest, count - 1)
    states, at_limit = known.states[frames], known.at_limit[frames]
    np.maximum.at(states, nearest, known.states)
    np.logical_or.at(at_limit, nearest, known.at_limit)

    def placed(points: Float[np.ndarray, "T *n 3"]) -> Float[np.ndarray, "T *n 3"]:
        return scene.in_reach(placement, placement.to_scene(points))

    low = np.array([0.0, 0.0, known.support_height])
    return {
        "corners": packed(placed(known.corners[frames])),
        "states": in_base64(states),
        "colors": [color for _, color in known.corner_states],
        "com": packed(placed(known.com[frames])),
        "support": float(placement.to_scene(low)[2]),
        "limits": [
            {
                "name": name,
                "frames": np.flatnonzero(at_limit[:, k]).tolist(),
                "points": packed(placed(known.joints[frames, k])[at_limit[:, k]]),
            }
            for k, name in enumerate(known.joint_names)
            if at_limit[:, k].any()
        ],
        "flags": [
            {
                "name": name,
                "runs": [
                    [round(start * known.frame_time, 4), round(stop * known.frame_time, 4)]
                    for start, stop in true_runs(up)
                ],
            }
            for name, up in known.flags.items()
            if up.any()
        ],
        "events": [
            {
                "start": event.start,
                "stop": event.stop,
                "measure": event.measure,
                "sentence": event.sentence,
            }
            for event in known.events
        ],
    }
