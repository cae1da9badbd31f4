"""What may stand in a message: ids and paths, checked before anything is done with them."""

import json
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
)

from contracts.config import SearchConfig, Vote, Weight
from contracts.errors import BadConfig, Refused, TaskFailed
from contracts.faults import first_fault
from index.files import read_text_file
from index.jobs import JobFolder, JobPlan
from workers.roots import Roots

MAX_MESSAGE_BYTES = 256 * 1024
"""Of a message as JSON. Ids and paths need a few hundred; a polygon of a search is the longest."""


@cache
def our_version() -> str:
    """The version of Flaneur that runs here."""
    return version("flaneur")


class Message(BaseModel):
    """Base of all messages: unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    @classmethod
    def parse(cls, content: object, roots: Roots | None = None) -> Self:
        """Check a message. roots : where its paths are on this machine; None: they are ours.

        Raises
        ------
        TaskFailed : it does not hold. Refused : a path in it is not for this worker.
        """
        try:
            return cls.model_validate(content, context=roots)
        except ValidationError as error:
            where, what = first_fault(error)
            told = f"{where}: {what}" if where else what
            raise TaskFailed(
                f"A message for {cls.__name__} does not hold ({told}). "
                "Are coordinator and workers of the same version?"
            ) from error


class Envelope(Message):
    """What every message travels in: who sent it, and on what terms.

    lease_s : how long a worker that is not heard of is believed to be at work.
    roots : where the coordinator has each root, by name.
    """

    version: str
    lease_s: Annotated[float, Field(gt=0, le=3600)]
    roots: dict[str, str]
    message: dict[str, Any]

    @classmethod
    def opened(cls, content: object) -> "Envelope":
        """Check an envelope.

        Raises
        ------
        TaskFailed : it is damaged or too large. Refused : it is of another version of Flaneur.
        """
        if isinstance(content, dict) and content.get("version") != our_version():
            raise Refused(
                f"this worker runs Flaneur {our_version()}, the coordinator "
                f"{str(content.get('version'))[:20]}. Install the same version on both."
            )
        if len(json.dumps(content)) > MAX_MESSAGE_BYTES:
            raise TaskFailed(f"A message is larger than {MAX_MESSAGE_BYTES} bytes.")
        return cls.parse(content)

    def sealed(self) -> dict[str, Any]:
        """As JSON, to be sent.

        Raises
        ------
        BadConfig : it is too large; workers would not read it.
        """
        content = self.model_dump(mode="json")
        if (size := len(json.dumps(content))) > MAX_MESSAGE_BYTES:
            raise BadConfig(
                f"A message would have {size} bytes; at most {MAX_MESSAGE_BYTES} are sent. A "
                "polygon of --within is the only thing that grows so: give it fewer corners."
            )
        return content


def _localised(path: str, info: ValidationInfo) -> str:
    return info.context.local(path) if isinstance(info.context, Roots) else path


SharedPath = Annotated[str, AfterValidator(_localised)]
"""A path as the coordinator names it; once parsed, where this machine has it."""


class JobMessage(Message):
    """Base of what is said of a job. config_digest : of the plan, as the coordinator sees it."""

    index: SharedPath
    job: Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
    config_digest: str

    def folder(self) -> JobFolder:
        """The job's folder.

        Raises
        ------
        Refused : this worker reads another configuration in its plan than the coordinator.
        """
        folder = JobFolder(Path(self.index), self.job)
        digest = folder.read_plan().config.digest()
        if digest != self.config_digest:
            raise Refused(
                f"this worker reads configuration {digest} in the plan of job {self.job}, the "
                f"coordinator {self.config_digest[:16]}. Install the same version on both."
            )
        return folder


def job_message(job: JobFolder, plan: JobPlan, **particulars: object) -> dict[str, object]:
    """The message of one task of a job. particulars : the other fields of its class."""
    digest = plan.config.digest()
    return {"index": str(job.root), "job": job.job, "config_digest": digest, **particulars}


Channel = Annotated[str, Field(pattern=r"^[a-z]+-[a-z]+$")]
"""A detector and a descriptor. Files are named by it: nothing else may stand in it."""


class ExtractMessage(JobMessage):
    shard: Annotated[int, Field(ge=0)]


class ProbeMessage(JobMessage):
    """Rows first_row to stop_row - 1 of a shard, to be extracted and thrown away."""

    shard: Annotated[int, Field(ge=0)]
    first_row: Annotated[int, Field(ge=0)]
    stop_row: Annotated[int, Field(ge=0)]


class TrainMessage(JobMessage):
    channel: Channel


class AssignMessage(JobMessage):
    shard: Annotated[int, Field(ge=0)]
    first_image_id: Annotated[int, Field(ge=0)]


class MergeMessage(JobMessage):
    """Words first_word to stop_word - 1. n_images : of the segment to be."""

    channel: Channel
    n_images: Annotated[int, Field(ge=0)]
    first_word: Annotated[int, Field(ge=0)]
    stop_word: Annotated[int, Field(ge=0)]


class JoinMessage(JobMessage):
    """`first_words` : of each range that was merged, ascending."""

    channel: Channel
    n_images: Annotated[int, Field(ge=0)]
    first_words: tuple[int, ...]


@lru_cache(maxsize=4)
def _search_of(path: str) -> SearchConfig:
    """The search in a file, whose name tells its content: it is read once a process."""
    try:
        return SearchConfig.model_validate_json(read_text_file(Path(path)))
    except (OSError, ValidationError) as error:
        raise TaskFailed(f"The search {path} cannot be read ({error}). Is it shared?") from error


def _read_search(search: object, info: ValidationInfo) -> object:
    return _search_of(_localised(search, info)) if isinstance(search, str) else search


class LocateMessage(Message):
    """`query` is the photo's name as the user gave it, `path` where it is read.

    search : or a file that holds it: a polygon would travel with every photo of a batch.
    plain : search by the baseline, a bag of words, instead.
    """

    index: SharedPath
    generation: int
    query: str
    path: SharedPath
    search: Annotated[SearchConfig, BeforeValidator(_read_search)]
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

    keep: SharedPath | None = None
    votes: tuple[Vote, ...]
    weightings: tuple[tuple[Weight, ...], ...]
    ks: tuple[int, ...]
