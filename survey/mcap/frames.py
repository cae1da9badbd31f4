"""The tree of frames that transforms make: world, vehicle, sensors (ROS REP 105)."""

from collections.abc import Mapping
from dataclasses import dataclass

from survey.mcap.tracks import (
    Asked,
    Bracket,
    Rigid,
    Samples,
    Track,
    bracket,
    identity,
    rigid_at,
    rigid_held,
)

_WORLDS = frozenset({"map", "world", "enu", "local_enu", "odom", "utm"})
_BODIES = frozenset({"base_link", "base_footprint"})
_EARTHS = frozenset({"earth", "ecef"})


def is_world(frame: str) -> bool:
    """Whether a frame's name says that it stands still on the ground."""
    return _last(frame) in _WORLDS


def is_adrift(frame: str) -> bool:
    """Whether a frame has a direction of its own: `odom` begins wherever the vehicle did."""
    return _last(frame).startswith("odom")


def is_body(frame: str) -> bool:
    """Whether a frame is by its name the vehicle's, with x forward: no camera's (REP 105)."""
    return _last(frame) in _BODIES


def is_geocentric(frame: str) -> bool:
    """Whether a frame's axes are those of the Earth, which are not east, north and up."""
    return _last(frame) in _EARTHS


def _last(frame: str) -> str:
    return frame.rpartition("/")[2].lower()


@dataclass(frozen=True, slots=True)
class Edge:
    """How a frame lies in its parent. fixed : it is mounted there and does not move."""

    parent: str
    track: Track
    fixed: bool

    def at(self, asked: Asked) -> Rigid:
        """The frame in its parent at given moments."""
        if self.fixed:
            return rigid_held(self.track, asked)
        return rigid_at(self.track, asked)


@dataclass(frozen=True, slots=True)
class FrameTree:
    """edges : of each frame that has a parent; without circles, as `frame_tree` builds them."""

    edges: Mapping[str, Edge]

    def chain(self, frame: str) -> tuple[str, ...]:
        """The frame and its ancestors, up to the root."""
        found = [frame]
        while (edge := self.edges.get(found[-1])) is not None:
            found.append(edge.parent)
        return tuple(found)

    def moves(self, upper: str, lower: str) -> bool:
        """Whether `lower` moves in its ancestor `upper`."""
        chain = self.chain(lower)
        return any(not self.edges[frame].fixed for frame in chain[: chain.index(upper)])

    def mounted(self, frame: str, other: str) -> bool:
        """Whether two frames are parts of one stiff body."""
        meeting = self._meeting(frame, other)
        return meeting is not None and not (
            self.moves(meeting, frame) or self.moves(meeting, other)
        )

    def between(self, outer: str, inner: str, asked: Asked) -> Rigid | None:
        """How `inner` lies in `outer`; None where no transforms join the two."""
        meeting = self._meeting(outer, inner)
        if meeting is None:
            return None
        down = self._from_ancestor(meeting, inner, asked)
        if meeting == outer:
            return down
        return self._from_ancestor(meeting, outer, asked).inverse().after(down)

    def around(self, upper: str, lower: str, asked: Asked) -> Bracket:
        """The messages around given moments, of the transform on the way that has the widest
        gaps; `upper` is an ancestor of `lower` and not itself."""
        chain = self.chain(lower)
        steps = [self.edges[frame] for frame in chain[: chain.index(upper)]]
        moving = [step for step in steps if not step.fixed] or steps[:1]
        brackets = [bracket(step.track.times_ns, asked) for step in moving]
        return min(brackets, key=lambda found: int(found.within.sum()))

    def _meeting(self, frame: str, other: str) -> str | None:
        """The nearest common ancestor."""
        others = set(self.chain(other))
        return next((name for name in self.chain(frame) if name in others), None)

    def _from_ancestor(self, top: str, frame: str, asked: Asked) -> Rigid:
        chain = self.chain(frame)
        found = identity(len(asked))
        for name in chain[: chain.index(top)]:
            found = self.edges[name].at(asked).after(found)
        return found


def frame_tree(transforms: Mapping[tuple[str, str], Samples], fixed: set[str]) -> FrameTree:
    """The tree of all transforms.

    transforms : (child, parent) -> samples of x, y, z, qx, qy, qz, qw. fixed : children that a
    topic of fixed transforms names; one that never changes is fixed as well. A child of several
    parents keeps the one that is stated most often, of these the first by name; a transform that
    would close a circle, and one from the whole Earth's frame, is left out.
    """
    edges: dict[str, Edge] = {}
    tree = FrameTree(edges)
    by_weight = sorted(transforms.items(), key=lambda item: (-len(item[1].times_ns), item[0]))
    for (child, parent), samples in by_weight:
        closes = child in tree.chain(parent)
        if child not in edges and not closes and not is_geocentric(parent):
            track = samples.track()
            edges[child] = Edge(parent, track, child in fixed or track.constant)
    return tree
