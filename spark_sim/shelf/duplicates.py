"""Near-duplicates: a motion that is there twice, under another name, in other units, at another
frame rate, turned about, trimmed, or with a little noise; and one that is a part of another."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.fft import fft, ifft, next_fast_len
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from spark_sim.shelf.fingerprint import RATE, Fingerprint, read

SAME = 0.03  # root mean square distance of unit vectors along limbs: 1.7 degrees
OF_VARIATION = 0.5  # and of how far the motion departs from its own mean: rest is like any rest
LEAST = 0.01  # below which the bytes of a fingerprint decide
COVERED = 0.8  # of the shorter motion's time that must be in the other
SHORTEST = 2.0  # [s] that two motions must share, unless they are of the same duration ...
SAME_DURATION = 0.03  # ... within this
_WINDOW = 8  # samples that a key looks at
_NEAREST, _RADIUS = 16, 0.15  # keys that are looked at for each of a motion, and how near
_DIRECTIONS = 12
_ALIKE = 0.05  # keys of one motion that are nearer than this are one


class Part(NamedTuple):
    """A motion that is in another one, from `start` [s] of that on."""

    name: str
    of: str
    start: float


@dataclass(frozen=True)
class Duplicates:
    """`groups` of motions that are nearly the same, and motions that are `parts` of longer ones."""

    groups: list[list[str]]
    parts: list[Part]

    def records(self) -> list[dict[str, str | float]]:
        """The parts for JSON."""
        return [{"motion": p.name, "of": p.of, "start_s": round(p.start, 3)} for p in self.parts]

    def sentences(self) -> Iterator[str]:
        """What there is to say of each group and part."""
        for group in self.groups:
            yield f"nearly the same motion: {', '.join(group)}"
        for name, of, start in self.parts:
            yield f"{name} is a part of {of}, from {start:.1f} s on"


def merged(found: Iterable[Duplicates]) -> Duplicates:
    """What was found among several sets of motions."""
    several = list(found)
    return Duplicates(
        [group for each in several for group in each.groups],
        [part for each in several for part in each.parts],
    )


def near_duplicates(fingerprints: Mapping[str, str]) -> Duplicates:
    """What is there more than once, by the fingerprints of motions.

    Each motion is compared with those of the nearest keys alone, so that the cost does not grow
    with the square of their number.
    """
    prints = {name: read(text) for name, text in sorted(fingerprints.items())}
    names = [name for name, each in prints.items() if each is not None]
    motions = [each for each in prints.values() if each is not None]
    group = list(range(len(names)))

    def first(k: int) -> int:
        while group[k] != k:
            group[k] = k = group[group[k]]
        return k

    inside: dict[int, tuple[float, int, float]] = {}
    for a, b in sorted(_candidates(motions)):
        if motions[a].duration > motions[b].duration:
            a, b = b, a
        shared = compare(motions[a], motions[b])
        if shared is None:
            continue
        if shared.overlap >= COVERED * motions[b].duration:
            low, high = sorted((first(a), first(b)))
            group[high] = low
        else:
            found = (shared.distance, b, max(shared.shift, 0.0))
            inside[a] = min(inside.get(a, found), found)
    groups: dict[int, list[str]] = {}
    for k, name in enumerate(names):
        groups.setdefault(first(k), []).append(name)
    return Duplicates(
        [members for members in groups.values() if len(members) > 1],
        [Part(names[a], names[b], start) for a, (_, b, start) in sorted(inside.items())],
    )


class Shared(NamedTuple):
    """What two motions have in common: the second's time [s] at which the first one begins, for how
    long [s] both are there, and the distance of unit vectors along their limbs."""

    shift: float
    overlap: float
    distance: float


def compare(one: Fingerprint, other: Fingerprint) -> Shared | None:
    """Where a motion lies in another one that is no shorter; None where it does not.

    Both may face anywhere. Limbs that only one of the two has don't count.
    """
    common = one.has & other.has
    a, b = one.samples[:, common], other.samples[:, common]
    whole = other.duration - one.duration <= SAME_DURATION * other.duration
    if len(a) >= _WINDOW:
        a, b = a[1:-1], b[1:-1]  # at a cut, smoothing did not see what follows
    least = max(COVERED * len(a), 1 if whole else SHORTEST * RATE - 2)
    limbs = max(int(common.sum()) - 1, 1)
    lags = np.arange(1 - len(a), len(b))
    starts, stops = np.maximum(-lags, 0), np.minimum(len(a), len(b) - lags)
    counts = stops - starts
    lags, starts, stops, counts = (x[counts >= least] for x in (lags, starts, stops, counts))
    if not len(lags):
        return None
    energy = _between(a, starts, stops) + _between(b, starts + lags, stops + lags)
    distances = (energy - 2 * _likeness(a, b)[lags]) / (counts * limbs)
    # Between two samples, a motion may be as far from itself as half a step takes it.
    steps = np.square(np.diff(a, axis=0)).sum() / max((len(a) - 1) * limbs, 1)
    coarse = SAME + 0.6 * float(steps) ** 0.5
    best = None
    for k in np.argsort(distances)[:2]:
        if distances[k] > coarse**2:
            break
        found = _refined(a[starts[k] : stops[k]], b, int(starts[k] + lags[k]), limbs)
        if best is None or found[0] < best[0]:
            best = (*found, int(lags[k]), int(counts[k]), a[starts[k] : stops[k]])
    if best is None:
        return None
    square, offset, lag, count, stretch = best
    variation = float(np.square(stretch - stretch.mean(axis=0)).sum() / (count * limbs)) ** 0.5
    distance = max(square, 0.0) ** 0.5
    if distance > max(LEAST, min(SAME, OF_VARIATION * variation)):
        return None
    shift = (lag + offset) / RATE
    overlap = min(one.duration, other.duration - shift) - max(-shift, 0.0)
    return Shared(shift, overlap, distance)


def _likeness(a: Float[np.ndarray, "A L 3"], b: Float[np.ndarray, "B L 3"]) -> np.ndarray:
    """The inner product of `a` with `b` from each lag on, turned about the vertical as fits best;
    negative lags stand at the end."""
    size = next_fast_len(len(a) + len(b) - 1)
    one, other = (fft(_level_and_upright(x), size, axis=0) for x in (a, b))
    level, upright = ifft((one.conj() * other).sum(axis=2), axis=0).T
    return np.asarray(np.abs(level) + upright.real)


def _level_and_upright(x: Float[np.ndarray, "T L 3"]) -> Complex[np.ndarray, "T 2 L"]:
    return np.stack([x[..., 0] + 1j * x[..., 1], x[..., 2].astype(complex)], axis=1)


def _between(x: Float[np.ndarray, "T L 3"], starts: np.ndarray, stops: np.ndarray) -> np.ndarray:
    """The sum of squares of frames from each start to each stop."""
    total = np.concatenate([[0.0], np.cumsum(np.square(x).sum(axis=(1, 2)))])
    return np.asarray(total[stops] - total[starts])


def _refined(
    a: Float[np.ndarray, "A L 3"], b: Float[np.ndarray, "B L 3"], start: int, limbs: int
) -> tuple[float, float]:
    """The mean square distance of `a` from `b` about the sample `start`, and how many samples from
    there it is least."""
    if len(b) < 2:
        return _distance(a, b[start : start + len(a)], limbs), 0.0
    near = slice(max(start - 2, 0), start + len(a) + 2)
    spline = CubicSpline(np.arange(len(b))[near], b[near])
    best = (np.inf, 0.0)
    for step in (1 / 8, 1 / 32):
        for offset in best[1] + step * np.arange(-4, 5):
            times = np.clip(start + offset + np.arange(len(a)), 0, len(b) - 1)
            best = min(best, (_distance(a, spline(times), limbs), float(offset)))
    return best


def _distance(a: Float[np.ndarray, "T L 3"], b: Float[np.ndarray, "T L 3"], limbs: int) -> float:
    """Mean square, of `b` turned about the vertical as fits best."""
    level = ((a[..., 0] - 1j * a[..., 1]) * (b[..., 0] + 1j * b[..., 1])).sum()
    likeness = (a[..., 2] * b[..., 2]).sum() + np.abs(level)
    return float(np.square(a).sum() + np.square(b).sum() - 2 * likeness) / (len(a) * limbs)


def _candidates(motions: list[Fingerprint]) -> set[tuple[int, int]]:
    """Pairs of motions with keys that are near to each other."""
    if len(motions) < 2:
        return set()
    indexed = [_distinct(_keys(each)[:: int(RATE)]) for each in motions]
    owner = np.repeat(np.arange(len(motions)), [len(each) for each in indexed])
    points = np.concatenate(indexed)
    # Most of how keys differ is in few directions; in more, a tree looks at nearly all of them.
    most = np.linalg.eigh(np.cov(points.T))[1][:, -_DIRECTIONS:]
    tree = cKDTree(points @ most)
    pairs: set[tuple[int, int]] = set()
    for k, motion in enumerate(motions):
        own = _keys(motion)
        last = max(len(own) - int(RATE), 0)
        at = {start + shift for start in (0, last // 2, last) for shift in range(int(RATE))}
        asked = own[sorted(i for i in at if i < len(own))]
        _, nearest = tree.query(asked @ most, _NEAREST, distance_upper_bound=_RADIUS)
        found = np.asarray(nearest)
        row, column = np.nonzero(found < len(owner))
        found = found[row, column]
        near = np.linalg.norm(asked[row] - points[found], axis=1) < _RADIUS
        others = set(owner[found[near]].tolist()) - {k}
        pairs |= {(min(k, other), max(k, other)) for other in others}
    return pairs


def _keys(motion: Fingerprint) -> Float[np.ndarray, "K D"]:
    """What a motion is like about each sample, whatever its heading: mean and spread, over a
    window, of how far limbs point up and aside."""
    samples = motion.samples
    up, aside = samples[..., 2], np.linalg.norm(samples[..., :2], axis=-1)
    values = np.concatenate([up, aside], axis=1)
    width = min(_WINDOW, len(values))
    windows = np.lib.stride_tricks.sliding_window_view(values, width, axis=0)
    return np.concatenate([windows.mean(axis=-1), windows.std(axis=-1)], axis=1)


def _distinct(keys: Float[np.ndarray, "K D"]) -> Float[np.ndarray, "N D"]:
    """Some of the keys, so that each of them is near to one of those."""
    kept = keys[:1]
    for key in keys[1:]:
        if np.linalg.norm(kept - key, axis=1).min() > _ALIKE:
            kept = np.concatenate([kept, key[None]])
    return kept
