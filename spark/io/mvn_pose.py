"""A person's pose as Xsens MVN sends it: the newest one, put together from datagrams."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.errors import ConventionError
from spark.io import mvn
from spark.io.live_pose import LivePose, Order, Places, Pose, SampleClock, tpose_of
from spark.io.mvn_body import (
    LIMBS,
    NEEDED,
    PARENTS,
    MvnConvention,
    convention_of,
    documented,
    from_tpose,
    leg_length,
    mean_body,
)
from spark.motion import Motion
from spark.rotation import quat_conj, quat_mul, quat_relative, quat_rotate
from spark.skeleton import Skeleton

_BEST = (mvn.QUATERNION, mvn.UNITY, mvn.EULER)  # of the types that hold a pose
_ROUNDS = 2**32  # the sample counter
Rows = Float[np.ndarray, "23 7"]
Mask = Bool[np.ndarray, "23"]
_SIZE = len(mvn.SEGMENTS)
_NEEDED = np.array([name in NEEDED for name in mvn.SEGMENTS])
_ALL_NEEDED = np.flatnonzero(_NEEDED)
_PARENT_ROWS = tuple(
    tuple(mvn.SEGMENTS.index(parent) for parent in PARENTS[name]) for name in mvn.SEGMENTS
)
_STRETCH = 0.1  # [m]: a joint that gives by more is no joint of this body


@dataclass
class MvnPose(LivePose):
    """The newest pose of an MVN sender: of the character that is heard of first.

    Arrays have a row for each of `mvn.SEGMENTS`, in the axes and the unit of the datagrams.
    """

    _order: Order = field(default_factory=lambda: Order(_ROUNDS))
    _samples: SampleClock = field(default_factory=SampleClock)
    _character: int | None = None
    _others: set[int] = field(default_factory=set)
    _kind: int | None = None
    _kinds: set[int] = field(default_factory=set)
    _names: dict[int, str] = field(default_factory=dict)  # of characters
    _scales: dict[int, Places] = field(default_factory=dict)
    _extras: tuple[int, int] = (0, 0)
    _sample: int = -1
    _parts: set[int] = field(default_factory=set)
    _contents: dict[int, int] = field(default_factory=dict)  # hashes
    _count: int = 0  # of the sample's parts; 0 while it is not known
    _coming: Rows = field(default_factory=lambda: np.zeros((_SIZE, 7)))
    _came: Mask = field(default_factory=lambda: np.zeros(_SIZE, dtype=bool))
    _pose: Rows = field(default_factory=lambda: np.zeros((_SIZE, 7)))
    _told: Mask = field(default_factory=lambda: np.zeros(_SIZE, dtype=bool))
    _known: Mask = field(default_factory=lambda: np.zeros(_SIZE, dtype=bool))
    _settled: bool = True
    _local: Rows = field(default_factory=lambda: np.zeros((_SIZE, 7)))  # in the parents
    _world: Rows = field(default_factory=lambda: np.zeros((_SIZE, 7)))
    _placed: Mask = field(default_factory=lambda: np.zeros(_SIZE, dtype=bool))
    _convention: MvnConvention | None = None

    def take(self, packet: bytes, now: float) -> bool:
        try:
            datagram = mvn.read(packet)
            if datagram.kind in (mvn.META, mvn.SCALE):
                return self._about(datagram)
            self._kinds.add(datagram.kind)
            if datagram.kind not in mvn.KINDS:
                return False
            which, values = mvn.segments(datagram)
        except ConventionError:
            self.dropped += 1
            return False
        whole = np.isin(_ALL_NEEDED, which).all()
        if self._character is None or (whole and self.missing):
            self._character = datagram.character
        if datagram.character != self._character:
            self._others.add(datagram.character)
            return False
        if self._kind is None or (whole and _BEST.index(datagram.kind) < _BEST.index(self._kind)):
            self._kind, self._convention, self._sample = datagram.kind, None, -1
            for mask in (self._told, self._known, self._placed):
                mask[:] = False
        if datagram.kind != self._kind:
            return False
        if self._order.is_late(datagram.sample, now):
            self.reordered += 1
            return False
        return self._collect(datagram, which, values, now)

    def _collect(
        self,
        datagram: mvn.Datagram,
        which: Int[np.ndarray, "N"],
        values: Float[np.ndarray, "N 7"],
        now: float,
    ) -> bool:
        """Put the parts of a sample together; a sample of which one is lost tells of nothing."""
        content = hash(datagram.payload)
        if self._contents.get(datagram.part) == content and datagram.sample == self._sample:
            self.repeated += 1
            return False
        if datagram.sample != self._sample or datagram.part in self._parts:
            self._sample, self._parts, self._contents, self._count = datagram.sample, set(), {}, 0
            self._came[:] = False
        self._parts.add(datagram.part)
        self._contents[datagram.part] = content
        self._coming[which], self._came[which] = values, True
        if datagram.last:
            self._count = datagram.part + 1
        if len(self._parts) != self._count:
            return False
        if not self._came.any():
            self.dropped += 1
            return False
        self._extras = datagram.props, datagram.fingers
        self._pose[self._came] = self._coming[self._came]
        self._told, self._settled = self._came.copy(), False
        self._known |= self._told
        self.heard.update(dict.fromkeys(np.array(mvn.SEGMENTS)[self._told].tolist(), now))
        self.frames += 1
        self.clock = self._samples.at(datagram.sample, datagram.time_ms)
        return True

    def _settle(self) -> None:
        """Find where each segment is in its parent. One that is not told of stays there."""
        if self._settled:
            return
        self._settled = True
        told, local, world, above = self._told, self._local, self._world, self._above()
        new, root = told & ~self._placed, above < 0
        if self._kind == mvn.UNITY:
            local[told] = self._pose[told]
        else:
            world[told] = self._pose[told]
            for j in np.flatnonzero(self._known & ~told).tolist():
                if self._placed[j] and above[j] >= 0:
                    up = world[above[j]]
                    world[j, :3] = up[:3] + quat_rotate(up[3:], local[j, :3])
                    world[j, 3:] = quat_mul(up[3:], local[j, 3:])
            up = world[above]
            turns = quat_relative(up[:, 3:], world[:, 3:])
            places = quat_rotate(quat_conj(up[:, 3:]), world[:, :3] - up[:, :3])
            local[told & root] = world[told & root]
            hangs = told & ~root
            local[hangs, 3:] = turns[hangs]
            # Where the parent is not told of, it is not where the segment's place is told from.
            sure = hangs & (told[above] | new)
            local[sure, :3] = places[sure]
        self._placed |= told

    def _above(self) -> Int[np.ndarray, "23"]:
        """The row of each segment's parent, among those that are sent; -1 where there is none."""
        out = np.full(_SIZE, -1)
        for j, rows in enumerate(_PARENT_ROWS):
            out[j] = next((row for row in rows if self._known[row]), -1)
        return out

    def _about(self, datagram: mvn.Datagram) -> bool:
        who = datagram.character
        if datagram.kind == mvn.META:
            self._names[who] = mvn.metadata(datagram).get("name", self._names.get(who, ""))
        elif places := mvn.scale(datagram):
            self._scales[who] = from_tpose(places)
        return False

    @property
    def missing(self) -> tuple[str, ...]:
        if not (_NEEDED & ~self._known).any():
            return ()
        return tuple(n for n in NEEDED if not self._known[mvn.SEGMENTS.index(n)])

    @property
    def notes(self) -> tuple[str, ...]:
        if self._kind is None:
            kinds = ", ".join(f"{kind:02d}" for kind in sorted(self._kinds)[:9])
            asks = f"switch on {mvn.KINDS[mvn.QUATERNION]!r} in MVN's network streamer"
            return (f"MVN datagrams of type {kinds} hold no pose; {asks}",) if kinds else ()
        name = self._names.get(self._character or 0, "")
        body = "the T-pose of a person of 1.7 m"
        if self._has_places or self._scaled:
            body = "the T-pose that it sent" if self._scaled else "the T-pose from its first pose"
        of = f" of {name!r}" if name else ""
        out = [f"MVN, {mvn.KINDS[self._kind]}{of}: {self._read()}; {body}"]
        props, fingers = self._extras
        if props or fingers:
            out.append(f"{fingers} segments of fingers and {props} props are left out")
        if self._others:
            which = ", ".join(map(str, sorted(self._others)[:9]))
            out.append(f"follows character {self._character}; leaves out {which}")
        return tuple(out)

    def bones(self) -> Places:
        known = [mvn.SEGMENTS[j] for j in np.flatnonzero(self._known).tolist()]
        told, local, reads = self._scaled, self._raw_places(), self._read()
        if not self._has_places and not told:
            mean = mean_body()
            return {name: mean[name] for name in known}
        out = {}
        if self._has_places:
            out = {name: reads.places(place) for name, place in local.items()}
        if out and any(np.abs(told[n] - out[n]).max() > _STRETCH for n in LIMBS if n in told):
            told = {}  # it is another's
        out |= {name: told[name] for name in known if name in told}
        return {name: out[name] for name in known if name in out}

    def tpose(self, frame_time: float) -> Motion:
        self._convention = None
        return tpose_of(self.bones(), PARENTS, frame_time)

    def frame(self, skeleton: Skeleton) -> Pose:
        reads, has_places = self._read(), self._has_places
        rows = [mvn.SEGMENTS.index(name) for name in skeleton.names]
        placed = self._placed[rows]
        raw = np.where(placed[:, None], self._local[rows], [0.0, 0, 0, 1, 0, 0, 0])
        told, places = reads.places(raw[:, :3]), skeleton.offsets.copy()
        # Joints give a little, so that feet stand where they stand.
        near = placed & has_places & (np.abs(told - places).max(1) < _STRETCH)
        near[0] = placed[0]
        places[near] = told[near]
        return places[0], reads.turns(raw[:, 3:]), places

    @property
    def _scaled(self) -> Places:
        """The places of segments in their parents, of the T-pose that was sent [m]."""
        raw = self._scales.get(self._character or 0, {})
        known = convention_of(raw, mvn.QUATERNION)
        return {name: known.places(place) for name, place in raw.items()}

    @property
    def _has_places(self) -> bool:
        return leg_length(self._raw_places()) > 0

    def _raw_places(self) -> Places:
        self._settle()
        return {mvn.SEGMENTS[j]: self._local[j, :3] for j in np.flatnonzero(self._placed).tolist()}

    def _read(self) -> MvnConvention:
        """How the datagrams are to be read; found out once the body is whole."""
        if self._convention is None and self._kind is not None and not self.missing:
            self._convention = convention_of(self._raw_places(), self._kind)
        return self._convention or documented(self._kind or mvn.QUATERNION)
