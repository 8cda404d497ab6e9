"""A pose that is held before or after a clip, as a T-pose that a converter put there, and stands on
another floor: the clip's is told without it, and it is put on that."""

from dataclasses import replace

from spark.rig.contacts import floor_under
from spark.runs import true_runs
from spark.transfer.analytic import FLOOR_TOLERANCE
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.soles import lowest_soles
from spark.transfer.stray_frames import jumps_of, repeats_of, strays_of


def on_one_floor(source: CanonicalMotion) -> CanonicalMotion:
    """`source` over the floor of the clip alone, and on it a pose that is held at an end and that
    nothing leads to; a note says how far it was away. Itself where that is not far."""
    if not any(repeats_of(source.picked(end))[-1] for end in (slice(2), slice(-2, None))):
        return source  # nothing is held: what follows takes a pose of each frame
    repeats, count = repeats_of(source), len(source)
    stray = strays_of(jumps_of(source), source.frame_time, repeats)
    ends = [
        (start, stop)
        for start, stop in true_runs(stray)
        if (start == 0 or stop == count) and stop - start > 1 and repeats[start + 1 : stop].all()
    ]
    if not ends:
        return source
    lowest = lowest_soles(source)
    floor, least = floor_under(lowest[~stray]), FLOOR_TOLERANCE * source.rig.hip_height
    hips, notes = source.hips.copy(), []
    for start, stop in ends:
        up = floor - floor_under(lowest[start:stop])
        if abs(up) > least:
            hips[start:stop, 2] += up
            where = "before" if start == 0 else "after"
            way = "below" if up > 0 else "above"
            notes.append(
                f"a pose {where} the clip, {abs(up):.2f} m {way} its floor, is put on that"
            )
    if not notes:
        return source
    return replace(source, hips=hips, floor_z=floor, notes=(*source.notes, *notes))
