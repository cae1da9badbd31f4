"""The whole forecast: hours, workers, memory and bytes of an index that is not there yet."""

from collections.abc import Sequence
from dataclasses import dataclass

from contracts.config import IndexConfig
from contracts.records import Skipped
from coordinator.forecast import costs
from coordinator.forecast.process import Held
from coordinator.forecast.ranges import Range, exactly, share_of, total
from coordinator.forecast.sample import Sample
from coordinator.forecast.stages import Stage, Tasks, equal_tasks, wall_s
from coordinator.forecast.storage import Storage, foresee_storage
from coordinator.forecast.vocabulary import Channel, foresee_channels
from retrieval.merging import POSTINGS_AT_ONCE, word_ranges
from retrieval.sampling import share_put_aside

_SHARD_COPIES = 2
"""An extract worker holds its shard's features and lays them end to end."""


@dataclass(frozen=True, slots=True)
class Machine:
    """slowness : against the reference of `costs`. idle : what a worker process holds that has
    done nothing yet; None: not known here."""

    slowness: float
    idle: Held | None


@dataclass(frozen=True, slots=True)
class Forecast:
    """What indexing will take. walls : seconds by number of worker processes.

    unreadable : images; None where all of the sample could be read.
    waiting : share of the sample's time in which its process waited for a core or the disk.
    slowness : of this machine, against the reference of `costs`.
    """

    n_images: int
    shard_size: int
    n_shards: int
    n_sampled: int
    skipped: tuple[Skipped, ...]
    unreadable: Range | None
    waiting: float
    slowness: float
    seconds_an_image: Range
    frames: dict[str, Range]
    channels: tuple[Channel, ...]
    stages: tuple[Stage, ...]
    walls: dict[int, Range]
    storage: Storage

    @property
    def core_s(self) -> Range:
        """Seconds of all tasks together."""
        return total(stage.core_s for stage in self.stages)

    @property
    def n_messages(self) -> int:
        """A task is one message to a worker and one result back."""
        return sum(stage.n_tasks for stage in self.stages)


def foresee(
    sample: Sample,
    config: IndexConfig,
    n_images: int,
    shard_size: int,
    n_workers: Sequence[int],
    machine: Machine,
) -> Forecast:
    """Work out what indexing `n_images` images takes, from a sample of them."""
    channels = foresee_channels(sample, config, n_images)
    n_shards = -(-n_images // shard_size)
    storage = foresee_storage(channels, n_images)
    work = _Work(sample, channels, storage, config, n_images, n_shards, machine)
    stages = (work.extract(), work.train(), work.assign(), work.merge(), work.join())
    n_skipped = len(sample.skipped)
    return Forecast(
        n_images=n_images,
        shard_size=shard_size,
        n_shards=n_shards,
        n_sampled=sample.n_images,
        skipped=sample.skipped,
        unreadable=share_of(n_skipped, sample.n_images).times(n_images) if n_skipped else None,
        waiting=sample.waiting,
        slowness=machine.slowness,
        seconds_an_image=sample.seconds_an_image(n_images),
        frames={
            detector: sample.frames_an_image(detector, n_images)
            for detector in config.features.detectors
        },
        channels=channels,
        stages=stages,
        walls={number: wall_s(stages, number, costs.START_S) for number in n_workers},
        storage=storage,
    )


@dataclass(frozen=True, slots=True)
class _Work:
    sample: Sample
    channels: tuple[Channel, ...]
    storage: Storage
    config: IndexConfig
    n_images: int
    n_shards: int
    machine: Machine

    def extract(self) -> Stage:
        seconds = self.sample.seconds_an_image(self.n_images).times(self.n_images)
        writing = self.storage.features.times(costs.WRITE_S_A_BYTE * self.machine.slowness)
        files = exactly(costs.FILE_S * self.n_shards)
        a_shard = self.storage.features.high / self.n_shards * _SHARD_COPIES
        return Stage(
            "extract",
            equal_tasks(self.n_shards, seconds + writing + files),
            self._private(a_shard, extracting=True),
            self._shared(),
        )

    def train(self) -> Stage:
        return Stage(
            "train",
            tuple(Tasks(1, self._training_s(channel)) for channel in self.channels),
            self._private(max(map(self._training_bytes, self.channels))),
            self._shared(),
        )

    def assign(self) -> Stage:
        modelled = sum(
            channel.points.likely * costs.assign_s(channel.n_words, channel.dimensions)
            for channel in self.channels
        )
        files = costs.CHANNEL_FILE_S * self.n_shards * len(self.channels)
        return Stage(
            "assign",
            equal_tasks(self.n_shards, self._modelled(modelled + files)),
            self._private(self.storage.searches.likely),
            self._shared(self.storage.words.likely),
        )

    def merge(self) -> Stage:
        tasks: list[Tasks] = []
        for channel in self.channels:
            ranges = len(word_ranges(channel.n_words, round(channel.points.likely)))
            work = channel.postings.likely * costs.MERGE_S_A_POSTING
            work += ranges * (costs.MERGE_S_A_RUN * self.n_shards + costs.FILE_S)
            tasks += equal_tasks(ranges, self._modelled(work))
        at_once = min(max(channel.points.high for channel in self.channels), POSTINGS_AT_ONCE)
        held = at_once * costs.MERGE_BYTES_A_POSTING + self.n_images * costs.MERGE_BYTES_AN_IMAGE
        return Stage("merge", tuple(tasks), self._private(held), self._shared())

    def join(self) -> Stage:
        n_channels = len(self.channels)
        n_bytes = self.storage.postings.likely + self.storage.tables.likely
        work = n_bytes * costs.JOIN_S_A_BYTE + n_channels * costs.FILE_S
        return Stage(
            "join",
            equal_tasks(n_channels, self._modelled(work)),
            self._private(self._joining_bytes()),
            self._shared(),
        )

    def _joining_bytes(self) -> float:
        """The tables of a channel, and one piece of it."""
        of_tables = max(channel.n_words for channel in self.channels) * costs.JOIN_BYTES_A_WORD
        pieces = sum(stage_tasks.number for stage_tasks in self.merge().tasks)
        piece = self.storage.postings.likely / max(pieces, 1)
        return of_tables + piece + self.n_images * costs.MERGE_BYTES_AN_IMAGE

    def _modelled(self, reference_s: float) -> Range:
        """Seconds here of work that took so long on the reference."""
        return exactly(reference_s * self.machine.slowness).within(costs.MODELLED_S_WITHIN)

    def _private(self, grown: float, *, extracting: bool = False) -> float | None:
        """A worker's own bytes. It extracted before, and what it took for that it keeps."""
        idle, memory = self.machine.idle, self.sample.memory
        if idle is None or memory is None:
            return None
        return idle.own + grown + (memory.at_most if extracting else memory.kept)

    def _shared(self, mapped: float = 0.0) -> float | None:
        idle = self.machine.idle
        return None if idle is None else idle.mapped + mapped

    def _trained_points(self, channel: Channel) -> int:
        return min(round(channel.points.likely), self.config.codebooks.max_train_points)

    def _training_s(self, channel: Channel) -> Range:
        points = self._trained_points(channel)
        found = channel.points.likely
        share = share_put_aside(found, self.config.codebooks.max_train_points)
        read = (share or 1.0) * found * channel.dimensions * costs.READ_S_A_BYTE
        read += self.n_shards * costs.SAMPLE_S_A_SHARD
        if not share:
            read += self.n_images * costs.SAMPLE_S_AN_IMAGE
        return self._modelled(read + costs.train_s(points, channel.n_words, channel.dimensions))

    def _training_bytes(self, channel: Channel) -> float:
        a_point = channel.dimensions * costs.TRAIN_BYTES_A_VALUE + costs.TRAIN_BYTES_A_POINT
        return self._trained_points(channel) * a_point
