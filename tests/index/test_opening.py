"""Opening an index reads its generation, and the size of everything else."""

from pathlib import Path

import pytest
from made_index import made_index

from contracts.errors import BadIndex
from index.opened import OpenedIndex


def test_nothing_of_words_lists_and_images_is_read_to_open_an_index(tmp_path: Path) -> None:
    generation = made_index(tmp_path, removed=(1,))
    for name, entry in generation.files.items():
        (tmp_path / name).write_bytes(b"\xff" * entry.size)
    opened = OpenedIndex(tmp_path)
    assert (opened.n_images, opened.n_live) == (10, 9)
    for read in (lambda: opened.kept, lambda: opened.parts("hesaff-sift")):
        with pytest.raises(BadIndex):
            read()
