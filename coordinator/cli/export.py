"""`flaneur export`: surveys, indices and results in the formats of other software."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.cli.lists import SOME_SKIPPED, SeenIndex
from coordinator.cli.opening import opened_index
from coordinator.cli.outputs import result_file, utf_8
from coordinator.cli.show import bars, list_skipped, tell
from coordinator.cli.survey_options import SurveyPath, reads_a_survey

if TYPE_CHECKING:  # reading a survey imports much
    from survey import ReadOptions

NAME = "export"
HELP = "Write a survey, an index or results in the formats of other software."


@reads_a_survey(without=("whole_panoramas", "no_track_headings", "stored_rotation", "no_masks"))
def mcap(
    survey: SurveyPath,
    out: Annotated[Path, typer.Argument(metavar="OUT.mcap", help="The MCAP file.")],
    reading: "ReadOptions",
) -> int:
    """A survey as one MCAP file: images, places and attitudes, for Foxglove and ROS 2."""
    from coordinator.export.mcap import write_mcap
    from survey import read_survey

    # What the survey itself says, nothing made of it; and MCAP has no place for masks.
    options = replace(reading, cut_panoramas=False, derive_headings=False, use_masks=False)
    out = result_file(out, (survey,))
    found = read_survey(survey.absolute(), options)
    for note in found.notes:
        tell(note)
    with bars() as progress:
        progress.begin("mcap", len(found.images), 0)
        written = write_mcap(found, out, lambda: progress.advance("mcap"), options.allow_ballpark)
    skipped = (*found.skipped, *written.skipped)
    list_skipped(skipped, "the survey")
    tell(f"{written.n_images} of {len(found.images) + len(found.skipped)} images: {out}")
    return SOME_SKIPPED if skipped else 0


def stac(
    index: SeenIndex,
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.")],
) -> None:
    """Every image of an index as a STAC item."""
    from coordinator.export.stac_folder import write_stac

    opened = opened_index(index)
    folder = folder.absolute()
    with bars() as progress:
        progress.begin("stac", opened.n_live, 0)
        write_stac(opened, folder, lambda: progress.advance("stac"))
    tell(f"{opened.n_live} items: {folder / 'collection.json'}")


def navplace(
    results: Annotated[
        Path, typer.Argument(metavar="RESULTS.geojson", help="Written by `flaneur locate`.")
    ],
    manifest: Annotated[
        Path, typer.Argument(metavar="MANIFEST.json", help="Of IIIF Presentation 3.")
    ],
    out: Annotated[Path, typer.Option(help="The manifest with places.")],
) -> int:
    """Estimates on the canvases of a IIIF manifest (navPlace)."""
    from coordinator.export.files import write_whole
    from coordinator.export.json_files import read_json, read_results
    from coordinator.export.navplace import with_places

    out = result_file(out, (results, manifest))
    placed = with_places(read_json(manifest), read_results(results), str(manifest))
    text = json.dumps(placed.manifest, allow_nan=False, ensure_ascii=False, indent=2)
    write_whole(out, utf_8(text))
    list_skipped(placed.left_out, "the results")
    tell(f"{placed.n_placed} of {placed.n_placed + len(placed.left_out)} queries placed: {out}")
    return SOME_SKIPPED if placed.left_out else 0


COMMANDS: dict[str, Callable[..., int | None]] = {
    "mcap": mcap,
    "stac": stac,
    "navplace": navplace,
}
