"""What may stand in a message: ids and paths, checked before anything is done with them."""

from pathlib import Path
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from contracts.config import SearchConfig, Vote, Weight
from contracts.errors import TaskFailed
from index.jobs import JobFolder


class Message(BaseModel):
    """Base of all messages: unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @classmethod
    def parse(cls, content: object) -> Self:
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            raise TaskFailed(
                f"A message for {cls.__name__} does not hold ({error.errors()[0]['msg']}). "
                "Are coordinator and workers of the same version?"
            ) from error


class _JobMessage(Message):
    index: str
    job: Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]

    def folder(self) -> JobFolder:
        return JobFolder(Path(self.index), self.job)


class ExtractMessage(_JobMessage):
    shard: Annotated[int, Field(ge=0)]


class TrainMessage(_JobMessage):
    channel: str


class AssignMessage(_JobMessage):
    shard: Annotated[int, Field(ge=0)]
    first_image_id: Annotated[int, Field(ge=0)]


class MergeMessage(_JobMessage):
    """Words first_word to stop_word - 1. n_images : of the segment to be."""

    channel: str
    n_images: Annotated[int, Field(ge=0)]
    first_word: Annotated[int, Field(ge=0)]
    stop_word: Annotated[int, Field(ge=0)]


class JoinMessage(_JobMessage):
    """`first_words` : of each range that was merged, ascending."""

    channel: str
    n_images: Annotated[int, Field(ge=0)]
    first_words: tuple[int, ...]


class LocateMessage(Message):
    """`query` is the photo's name as the user gave it, `path` where it is read.

    plain : search by the baseline, a bag of words, instead.
    """

    index: str
    generation: int
    query: str
    path: str
    search: SearchConfig
    plain: bool = False


class JudgeMessage(LocateMessage):
    """`relevant` : ids of the images that show the query's place.

    junk : ids that are neither right nor wrong.
    box : x1 y1 x2 y2, pixels of the upright photo in its original size, from its upper left
        corner; only frames whose centre lies in it are searched with. None: all of them.
    """

    relevant: tuple[int, ...]
    junk: tuple[int, ...] = ()
    box: tuple[float, float, float, float] | None = None


class RehearseMessage(JudgeMessage):
    """Every detector, pair and k is tried, for training and comparing.

    By each of `votes` with each of `weightings`; those of the search itself may be among them.
    keep : a file where the votes of the single detectors by the search's own rule are left.
    """

    keep: str | None = None
    votes: tuple[Vote, ...]
    weightings: tuple[tuple[Weight, ...], ...]
    ks: tuple[int, ...]
