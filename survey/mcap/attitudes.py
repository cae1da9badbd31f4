"""Where the poses and transforms of a recording put each camera, and how they turn it.

A camera's frame has x right, y down and z forward (REP 103, `sensor_msgs/Image`); the world has
x east, y north and z up.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geo.rotations import FRD_FROM_RDF
from survey.mcap.frames import FrameTree, is_adrift, is_body, is_geocentric, is_world
from survey.mcap.recording import CameraKey, PoseTopic, Recording
from survey.mcap.tracks import Asked, Bracket, Rigid, bracket, rigid_at

_FLU_FROM_RDF = np.diag([1.0, -1.0, -1.0]) @ FRD_FROM_RDF
"""(3, 3): a camera that looks along the x axis of a vehicle with y left and z up (REP 103)."""


@dataclass(frozen=True, slots=True)
class Source:
    """One way to place a camera.

    name : its topic, and `frame` the world it counts from. rank : the lower the better.
    around : the messages around the m moments. camera : how the camera lies in the world at them.
    assumed_forward : its mounting is not known and is taken to look ahead.
    """

    name: str
    frame: str
    rank: int
    around: Bracket
    camera: Rigid
    assumed_forward: bool = False

    @property
    def adrift(self) -> bool:
        """Whether its north is nobody's north."""
        return is_adrift(self.frame)

    def stands(self) -> NDArray[np.bool_]:
        """(m,) whether the position is known."""
        return np.asarray(np.isfinite(self.camera.position).all(axis=1))

    def turns(self) -> NDArray[np.bool_]:
        """(m,) whether the attitude is known."""
        return np.asarray(np.isfinite(self.camera.rotation).all(axis=(1, 2)))


def sources(recording: Recording, tree: FrameTree, camera: CameraKey, asked: Asked) -> list[Source]:
    """Every way in which the recording places a camera."""
    alone = len(recording.images) == 1
    found = [
        source
        for topic in recording.poses
        if (source := _of_topic(recording, tree, topic, camera, asked, alone))
    ]
    return found + list(_of_tree(tree, camera, asked, alone))


def _of_topic(
    recording: Recording,
    tree: FrameTree,
    topic: PoseTopic,
    camera: CameraKey,
    asked: Asked,
    alone: bool,
) -> Source | None:
    if is_geocentric(topic.frame) or _aboard(tree, topic.frame, camera.frame):
        return None
    track = recording.poses[topic].track()
    pose = rigid_at(track, asked)
    body = topic.body or _carried(tree, topic.frame, camera.frame)
    mounting = None
    if body is not None and not is_body(camera.frame):
        mounting = tree.between(body, camera.frame, asked)
    assumed = mounting is None
    if mounting is None:
        mounting = _ahead(len(asked)) if alone else _unknown(len(asked))
    lies = pose.after(mounting)
    world = tree.chain(topic.frame)[-1]
    outer = tree.between(world, topic.frame, asked)
    lies = lies if outer is None else outer.after(lies)
    around = bracket(track.times_ns, asked)
    return Source(topic.topic, world, 0 if topic.body else 1, around, lies, assumed)


def _aboard(tree: FrameTree, frame: str, camera: str) -> bool:
    """Whether a frame travels with the camera: what lies in it is a thing that was seen."""
    if not frame or is_world(frame):
        return False
    return frame == camera or tree.mounted(frame, camera)


def _ahead(count: int) -> Rigid:
    return Rigid(np.tile(_FLU_FROM_RDF, (count, 1, 1)), np.zeros((count, 3)))


def _unknown(count: int) -> Rigid:
    return Rigid(np.full((count, 3, 3), np.nan), np.zeros((count, 3)))


def _carried(tree: FrameTree, world: str, camera: str) -> str | None:
    """Whose pose a message gives that does not say so: of the topmost frame that moves.

    None where no transform says what the camera is mounted on.
    """
    if camera not in tree.edges:
        return None
    chain = tree.chain(camera)
    if world in chain:
        chain = chain[: chain.index(world)]
    elif is_world(chain[-1]):
        chain = chain[:-1]
    return chain[-1] if chain else None


def _of_tree(tree: FrameTree, camera: CameraKey, asked: Asked, alone: bool) -> Iterator[Source]:
    """The tree itself, if its root is the world and not the vehicle."""
    root = tree.chain(camera.frame)[-1]
    if root == camera.frame or not (is_world(root) or tree.moves(root, camera.frame)):
        return
    lies = tree.between(root, camera.frame, asked)
    if lies is None:
        return
    assumed = is_body(camera.frame)
    if assumed:
        lies = lies.after(_ahead(len(asked)) if alone else _unknown(len(asked)))
    around = tree.around(root, camera.frame, asked)
    yield Source("transforms", root, 2, around, lies, assumed)
