"""Options and the exit code that the verbs share."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, get_args

import typer

from contracts.config import (
    DESCRIPTORS,
    DETECTORS,
    MAX_NEIGHBOURS,
    FeatureConfig,
    SearchConfig,
    Weight,
)
from contracts.config import Vote as VoteName
from contracts.errors import BadConfig
from contracts.places import Place, is_url, place_of

DEFAULT_VOTE: VoteName = SearchConfig().vote

SOME_SKIPPED = 3
"""Exit code: done, but some images were skipped."""

Broker = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="A Redis server, such as redis://host:6379/0, with workers started by "
        "`flaneur worker`. Without it (and FLANEUR_BROKER_URL) Flaneur brings its own.",
    ),
]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Local worker processes; default: one a core.")
]
JOB_PRIORITY = 7
Priority = Annotated[
    int,
    typer.Option(
        min=1,
        max=9,
        help="Among the jobs of a broker: 1 first, 9 last; `locate` goes before all of them.",
    ),
]


def given_place(text: str) -> Place:
    """Read a path or a URL; typer makes a path of neither."""
    try:
        return place_of(text)
    except BadConfig as error:
        raise typer.BadParameter(str(error)) from error


def own_folder(text: str) -> Path:
    """Read the path of an index that is to be changed."""
    if is_url(text):
        raise typer.BadParameter(
            f"{text} is in a store, and an index is changed in a folder. Name the folder, and "
            f"then publish it: flaneur publish INDEX {text}"
        )
    return Path(text)


IndexFolder = Annotated[
    Place,
    typer.Option(
        "--index",
        parser=given_place,
        metavar="INDEX",
        help="The index to search: its folder, or the URL that it was published to.",
    ),
]
SeenIndex = Annotated[
    Place,
    typer.Argument(
        parser=given_place,
        metavar="INDEX",
        help="The index: its folder, or the URL that it was published to.",
    ),
]
OwnIndex = Annotated[Path, typer.Argument(parser=own_folder, metavar="INDEX", help="The index.")]
Truth = Annotated[
    Path,
    typer.Option(
        help="JSON: query path -> relevant references; or a folder of Oxford/Paris lists; or an "
        "INRIA Holidays list."
    ),
]
TruthRoot = Annotated[
    Path | None,
    typer.Option(
        help="Folder of the queries; default: the truth file's, or for Oxford/Paris and Holidays "
        "the index's own images."
    ),
]
Pair = Annotated[
    str, typer.Option(help="auto, or one to six detectors such as hesaff,star.", show_default=True)
]
K = Annotated[str, typer.Option("--k", help="Words per keypoint: auto, or 1 to 10.")]
Vote = Annotated[
    str,
    typer.Option(
        help="union, intersection, pairwise; or auto: pairwise, with one descriptor intersection."
    ),
]
Weights = Annotated[str, typer.Option(help="Any of idf,norm,burst; '' for none.")]
MaxFrames = Annotated[
    str | None,
    typer.Option(help="Frames a detector and image, such as 1000 or 1000,orb=500; default: 1000."),
]
Descriptors = Annotated[
    str | None, typer.Option(help="Any of sift,surf,sc; default: all of the index.")
]


def names(text: str | None) -> tuple[str, ...]:
    """Split a comma-separated option."""
    return tuple(part.strip() for part in (text or "").split(",") if part.strip())


def names_among(text: str | None, known: Sequence[str], option: str) -> tuple[str, ...]:
    """Split a comma-separated option whose values are known, each to be named once.

    Raises
    ------
    BadConfig : a value is unknown or there twice; names it and what is known.
    """
    chosen = names(text)
    for at, name in enumerate(chosen):
        if name not in known:
            raise BadConfig(f"{option} takes any of {','.join(known)}; got {name!r}")
        if name in chosen[:at]:
            raise BadConfig(f"{option} names {name} twice; once is enough")
    return chosen


def frame_limits(text: str) -> dict[str, object]:
    """Read `1000`, `hesaff=1500,orb=500` or `800,orb=500` as settings of `FeatureConfig`.

    Raises
    ------
    BadConfig : a part is neither a number nor detector=number.
    """
    settings: dict[str, object] = {}
    limits: dict[str, int] = {}
    for part in names(text):
        detector, equals, number = part.rpartition("=")
        if not number.isascii() or not number.isdigit() or bool(equals) != (detector in DETECTORS):
            raise BadConfig(
                "--max-frames takes a number, and detector=number for those that shall differ, "
                f"such as 1000,orb=500; got {part!r}"
            )
        if equals:
            limits[detector] = int(number)
        else:
            settings["max_frames"] = int(number)
    return {**settings, "max_frames_of": limits}


def search_config(
    pair: str, k: str, vote: str, weights: str, descriptors: str | None, top: int
) -> SearchConfig:
    """Build the search from what was typed.

    Raises
    ------
    BadConfig : an option does not hold; names it.
    """
    if k not in {"auto", *map(str, range(1, MAX_NEIGHBOURS + 1))}:
        raise BadConfig(f"--k takes auto or a whole number from 1 to {MAX_NEIGHBOURS}; got {k!r}")
    if vote not in {"auto", *get_args(VoteName)}:
        raise BadConfig(f"--vote takes auto, {', '.join(get_args(VoteName))}; got {vote!r}")
    return SearchConfig.of(
        pair="auto" if pair == "auto" else names_among(pair, DETECTORS, "--pair"),
        k="auto" if k == "auto" else int(k),
        vote=DEFAULT_VOTE if vote == "auto" else vote,
        weights=names_among(weights, get_args(Weight), "--weights"),
        descriptors=names_among(descriptors, DESCRIPTORS, "--descriptors") or None,
        top=top,
    )


def fitted_search(search: SearchConfig, vote: str, indexed: FeatureConfig) -> SearchConfig:
    """Fit a search to an index: settle `--vote auto`, refuse what was not indexed.

    It happens before a worker is started.

    Raises
    ------
    BadConfig : names what is missing and what the index has.
    """
    alone = len(search.descriptors or indexed.descriptors) < 2
    if vote == "auto" and alone:
        search = search.model_copy(update={"vote": "intersection"})
    if search.vote == "pairwise" and alone:
        raise BadConfig(
            "--vote pairwise compares descriptors and there is only one here; "
            "use --vote intersection"
        )
    pair = () if search.pair == "auto" else search.pair
    for option, asked, has in (
        ("--pair", pair, indexed.detectors),
        ("--descriptors", search.descriptors or (), indexed.descriptors),
    ):
        missing = [name for name in asked if name not in has]
        if missing:
            raise BadConfig(
                f"{option}: the index has no {', '.join(missing)}; it was made with "
                f"{', '.join(has)}. Choose from these or index again."
            )
    return search
