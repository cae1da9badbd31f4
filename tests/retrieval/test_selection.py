"""Which candidate frames are kept."""

import numpy as np
import pytest
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.selection import inside, no_frames, round_frames, sort_frames, spread

SHAPE = (300, 400)


def _cluttered(seed: int = 0) -> Frames:
    """2,000 strong frames in one corner, 400 weaker ones everywhere."""
    rng = np.random.default_rng(seed)
    corner = rng.uniform(0, 60, (2000, 2))
    everywhere = rng.uniform(0, 1, (400, 2)) * (SHAPE[1], SHAPE[0])
    response = np.concatenate((rng.uniform(10, 20, 2000), rng.uniform(1, 2, 400)))
    xy = np.concatenate((corner, everywhere)).astype(np.float32)
    return round_frames(xy, np.full(2400, 4, np.float32), response.astype(np.float32))


def _quota_oracle(frames: Frames, max_frames: int) -> set[tuple[float, float]]:
    """Deal frames to cells one round after the other, the strongest first in each round."""
    ranked = sorted(
        range(len(frames)), key=lambda i: (-frames.response[i], frames.xy[i, 1], frames.xy[i, 0])
    )[: 5 * max_frames]
    side = (SHAPE[0] * SHAPE[1] / 49) ** 0.5
    cells: dict[tuple[int, int], list[int]] = {}
    for i in ranked:
        cells.setdefault((int(frames.xy[i, 1] // side), int(frames.xy[i, 0] // side)), []).append(i)
    chosen: list[int] = []
    while len(chosen) < max_frames and any(cells.values()):
        heads = sorted((ranked.index(rows[0]), cell) for cell, rows in cells.items() if rows)
        chosen += [cells[cell].pop(0) for _, cell in heads][: max_frames - len(chosen)]
    return {(float(frames.xy[i, 0]), float(frames.xy[i, 1])) for i in chosen}


def test_a_cluttered_corner_does_not_take_all() -> None:
    frames = _cluttered()
    kept = spread(frames, SHAPE, 1000)
    outside = (kept.xy > 60).any(axis=1).sum()
    assert len(kept) == 1000
    assert outside > 350
    strongest = np.argsort(-frames.response)[:1000]
    assert (frames.xy[strongest] > 60).any(axis=1).sum() == 0


@pytest.mark.parametrize("max_frames", [1, 7, 100, 799])
def test_selection_deals_frames_to_cells_in_rounds(max_frames: int) -> None:
    frames = _cluttered()
    kept = {(float(x), float(y)) for x, y in spread(frames, SHAPE, max_frames).xy}
    assert kept == _quota_oracle(frames, max_frames)


def test_selection_does_not_depend_on_the_order_found() -> None:
    frames = _cluttered()
    shuffle = np.random.default_rng(1).permutation(len(frames))
    other = Frames(frames.xy[shuffle], frames.shape[shuffle], frames.response[shuffle])
    kept, again = spread(frames, SHAPE, 300), spread(other, SHAPE, 300)
    assert np.array_equal(kept.xy, again.xy)
    assert np.array_equal(kept.response, again.response)


def test_equal_responses_are_ordered_by_y_then_x() -> None:
    xy = np.array([[5, 9], [7, 2], [1, 9], [3, 2]], np.float32)
    ordered = sort_frames(round_frames(xy, np.ones(4, np.float32), np.ones(4, np.float32)))
    assert ordered.xy.tolist() == [[3, 2], [7, 2], [1, 9], [5, 9]]


def _single(x: float, y: float, radius: float) -> Frames:
    one = np.ones(1, np.float32)
    return round_frames(np.array([[x, y]], np.float32), radius * one, one)


@pytest.mark.parametrize(
    ("x", "radius", "kept"),
    [(100, 20, True), (195, 3, True), (195, 20, False), (201, 3, False), (230, 3, False)],
)
def test_a_frame_that_looks_at_the_mask_or_its_outline_is_dropped(
    x: float, radius: float, kept: bool
) -> None:
    usable: NDArray[np.bool_] = np.ones(SHAPE, np.bool_)
    usable[:, 200:] = False
    assert inside(_single(x, 150, radius), SHAPE, usable).tolist() == [kept]


def test_a_frame_that_leaves_the_picture_is_dropped() -> None:
    assert inside(_single(3, 150, 20), SHAPE, None).tolist() == [False]
    assert inside(_single(30, 150, 20), SHAPE, None).tolist() == [True]


def test_a_mask_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="resize the mask"):
        inside(_single(3, 3, 1), SHAPE, np.ones((3, 3), np.bool_))


def test_nothing_selected_from_nothing() -> None:
    assert len(spread(no_frames(), SHAPE, 10)) == 0
