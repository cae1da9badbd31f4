"""A look at some image files: whether they open, how large they are, how they stand."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence

from contracts.errors import UnusableImage
from contracts.records import PosedImage
from survey.doctor.findings import Finding, share
from survey.image_header import read_header

SAMPLE = 200
_SMALL_SIDE_PX = 480
_RARE_SHARE = 0.1


def check_pictures(images: Sequence[PosedImage]) -> Iterator[Finding]:
    """Headers of at most 200 images, spread evenly over the survey."""
    sample = evenly(images, SAMPLE)
    sizes: dict[str, list[tuple[int, int]]] = defaultdict(list)
    bad: list[tuple[str, str]] = []
    for image in sample:
        try:
            header = read_header(image.path, image.fragment)
        except UnusableImage as error:
            bad.append((image.uri, str(error)))
            continue
        turned = image.quarter_turns % 2 == 1
        width, height = header.width_px, header.height_px
        sizes[image.camera.name].append((height, width) if turned else (width, height))
    if bad:
        yield Finding(
            "unreadable",
            "error" if len(bad) > _RARE_SHARE * len(sample) else "warning",
            f"{share(len(bad), len(sample))} files looked at cannot be read, of {len(images):,} in "
            f"all; the first {bad[0][1]}",
            tuple(uri for uri, _ in bad),
            "copy them again, or --exclude them",
        )
    for camera, found in sorted(sizes.items()):
        yield from _sizes(camera, found)


def evenly(images: Sequence[PosedImage], most: int) -> list[PosedImage]:
    """At most so many, spread over the whole from the first to the last."""
    if len(images) <= most:
        return list(images)
    step = (len(images) - 1) / (most - 1)
    return [images[round(number * step)] for number in range(most)]


def _sizes(camera: str, found: Sequence[tuple[int, int]]) -> Iterator[Finding]:
    name = f"camera {camera}" if camera else "the survey"
    counts = Counter(found)
    tiny = sum(count for size, count in counts.items() if max(size) < _SMALL_SIDE_PX)
    if tiny:
        yield Finding(
            "image-size",
            "warning",
            f"{share(tiny, len(found))} images of {name} looked at are small (longer side below "
            f"{_SMALL_SIDE_PX} px): thumbnails? They give few keypoints",
            mend="survey the full images, or --exclude the small ones",
        )
    wide = sum(count for (width, height), count in counts.items() if width > height)
    tall = sum(count for (width, height), count in counts.items() if width < height)
    if wide and tall:
        yield Finding(
            "orientation",
            "note",
            f"{wide:,} images of {name} looked at are wide and {tall:,} tall: check that all "
            "stand upright",
        )
    elif len(counts) > 1 and camera:
        common = ", ".join(f"{w} x {h} ({count:,})" for (w, h), count in counts.most_common(3))
        yield Finding("image-size", "note", f"images of {name} differ in size: {common}")
