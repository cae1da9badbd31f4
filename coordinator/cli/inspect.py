"""`flaneur inspect`: what every detector sees in one photo, as a picture and as numbers."""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from contracts.config import DETECTORS, FeatureConfig, IndexConfig
from contracts.errors import BadConfig
from contracts.places import Place
from coordinator.cli.lists import MaxFrames, frame_limits, given_place, names_among
from coordinator.cli.opening import opened_index
from coordinator.cli.outputs import result_file, utf_8
from coordinator.cli.show import stdout, tell

if TYPE_CHECKING:  # drawing and detecting are imported when the verb runs
    from coordinator.inspecting import Inspection
    from workers.stages.retrieve import Configured

NAME = "inspect"
_SUFFIXES = (".png", ".jpg", ".jpeg")


def command(
    photo: Annotated[Path, typer.Argument(metavar="PHOTO", help="The photo to look at.")],
    out: Annotated[Path, typer.Option(help="The picture: a .png or .jpg file.")],
    index: Annotated[
        Place | None,
        typer.Option(
            parser=given_place,
            metavar="INDEX",
            help="See and choose as this index does; default: as a new one would.",
        ),
    ] = None,
    detectors: Annotated[
        str | None, typer.Option(help=f"Which to run; default: {','.join(DETECTORS)}.")
    ] = None,
    max_frames: MaxFrames = None,
    mask: Annotated[
        Path | None,
        typer.Option(help="An image, bright where the photo shows the vehicle: no frames there."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> int:
    """Draw the frames that each detector finds in a photo, and the pair it is searched with."""
    from workers.run import worker_environment

    os.environ.update(worker_environment())  # before numba is imported: the workers' kernels
    import cv2

    from coordinator.export.files import write_whole
    from coordinator.export.inspection import picture
    from coordinator.inspecting import NoIndex, inspect_photo
    from retrieval.features import compile_kernels

    suffix = _picture_suffix(out)
    target = result_file(out, (photo,) if mask is None else (photo, mask))
    if index is None:
        seen_as: Configured = NoIndex(IndexConfig(features=_features(detectors, max_frames)))
    elif detectors is None and max_frames is None:
        seen_as = opened_index(index)
    else:
        raise BadConfig(
            "--index brings its own detectors and number of frames: leave --detectors and "
            "--max-frames away, or --index"
        )
    cv2.setNumThreads(1)  # as in a worker, so that the seconds are a worker's
    compile_kernels()
    inspection = inspect_photo(photo, mask, seen_as)
    write_whole(target, picture(inspection, suffix))
    if as_json:
        report = json.dumps(_report(photo, inspection), ensure_ascii=False, allow_nan=False)
        typer.echo(utf_8(report))
    else:
        stdout.print(_table(inspection))
        chosen = inspection.chosen
        stdout.print(
            f"Searched with {' + '.join(chosen.detectors)}, k = {chosen.k} ({chosen.choice})",
            markup=False,
            soft_wrap=True,
        )
        tell(f"Drawn: {out}")
    return 0


def _picture_suffix(out: Path) -> str:
    suffix = out.suffix.lower()
    if suffix not in _SUFFIXES:
        raise BadConfig(f"--out takes a name that ends in .png or .jpg; got {str(out)!r}")
    return suffix


def _features(detectors: str | None, max_frames: str | None) -> FeatureConfig:
    return FeatureConfig.of(
        detectors=names_among(
            ",".join(DETECTORS) if detectors is None else detectors, DETECTORS, "--detectors"
        ),
        **frame_limits(max_frames or ""),
    )


def _report(photo: Path, inspection: "Inspection") -> dict[str, object]:
    decoded, chosen = inspection.decoded, inspection.chosen
    return {
        "photo": str(photo),
        "width_px": decoded.width_px,
        "height_px": decoded.height_px,
        "inspected_width_px": decoded.rgb.shape[1],
        "inspected_height_px": decoded.rgb.shape[0],
        "detectors": [
            {
                "detector": seen.detector,
                "n_frames": len(seen.frames),
                "coverage": seen.coverage,
                "median_radius_px": seen.median_radius_px,
                "seconds": round(seen.seconds, 3),
                "chosen": seen.detector in chosen.detectors,
            }
            for seen in inspection.seen
        ],
        "pair": chosen.detectors,
        "k": chosen.k,
        "predicted_map": chosen.predicted_map,
        "choice": chosen.choice,
    }


def _table(inspection: "Inspection") -> Table:
    table = Table()
    table.add_column("detector")
    for heading in ("frames", "coverage", "median radius, px", "seconds"):
        table.add_column(heading, justify="right")
    for seen in inspection.seen:
        radius = seen.median_radius_px
        table.add_row(
            seen.detector,
            f"{len(seen.frames):,}",
            f"{seen.coverage:.0%}",
            "-" if radius is None else f"{radius:.1f}",
            f"{seen.seconds:.2f}",
            style="bold" if seen.detector in inspection.chosen.detectors else None,
        )
    return table
