"""The map of a survey's track, looked at through its pixels."""

import io
from collections.abc import Collection

import numpy as np
import pytest
from PIL import Image

from contracts.records import Camera, Pose, PosedImage
from coordinator.export.track_map import draw_track
from survey.doctor.track import track_of

RED = (0xD1, 0x00, 0x1C)


def posed(number: int, x: float, y: float) -> PosedImage:
    return PosedImage(
        f"{number:03d}.jpg",
        "",
        pose=Pose(652_000.0 + x, 6_862_000.0 + y, "EPSG:2154", heading_deg=0.0),
        camera=Camera("one"),
    )


def drawn(images: list[PosedImage], suspects: Collection[str] = ()) -> np.ndarray:
    """(h, w, 3) of the picture without its title and note; without times there is no colour bar."""
    png = draw_track("A <street> of $5", track_of(images, "EPSG:2154"), suspects, ["a note"])
    with Image.open(io.BytesIO(png)) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    return pixels[60:-50]


def coloured(pixels: np.ndarray) -> np.ndarray:
    """(n, 2) rows and columns of pixels that are neither grey nor red."""
    spread = pixels.max(axis=2).astype(int) - pixels.min(axis=2)
    return np.argwhere((spread > 60) & ~is_red(pixels))


def is_red(pixels: np.ndarray) -> np.ndarray:
    return np.abs(pixels.astype(int) - RED).max(axis=2) < 60


def test_north_is_up_and_metres_are_equal_in_x_and_y() -> None:
    corners = [(0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0), (50.0, 140.0)]
    places = coloured(drawn([posed(at, x, y) for at, (x, y) in enumerate(corners)]))
    top = places[places[:, 0] < places[:, 0].min() + 20]
    bottom = places[places[:, 0] > places[:, 0].max() - 20]
    height, width = np.ptp(places, axis=0)
    assert height / width == pytest.approx(1.4, abs=0.05)
    assert np.ptp(top[:, 1]) < 0.2 * width  # the single place furthest north
    assert np.ptp(bottom[:, 1]) > 0.9 * width


def test_suspects_are_marked_red() -> None:
    street = [posed(at, 5.0 * at, 0.0) for at in range(20)]
    assert not is_red(drawn(street)).any()
    red = np.argwhere(is_red(drawn(street, {"010.jpg"})))
    places = coloured(drawn(street))
    middle = (places[:, 1].min() + places[:, 1].max()) / 2.0
    assert np.abs(np.median(red[:, 1]) - middle) < 0.6 * np.ptp(places[:, 1])


def test_a_stray_does_not_shrink_the_map() -> None:
    street = [posed(at, 5.0 * at, 3.0 * (at % 2)) for at in range(60)]
    astray = [*street, posed(99, 400_000.0, 0.0)]
    assert np.ptp(coloured(drawn(astray))[:, 1]) > 0.8 * np.ptp(coloured(drawn(street))[:, 1])
    assert is_red(drawn(astray)).any()


@pytest.mark.parametrize("count", [1, 2, 5_000])
def test_any_number_of_images_can_be_drawn(count: int) -> None:
    images = [posed(at, 3.0 * (at % 100), 20.0 * (at // 100)) for at in range(count)]
    assert len(coloured(drawn(images)))


def test_the_same_survey_gives_the_same_bytes() -> None:
    street = track_of([posed(at, 5.0 * at, 0.0) for at in range(5)], "EPSG:2154")
    assert draw_track("a", street, ()) == draw_track("a", street, ())
