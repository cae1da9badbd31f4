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


@pytest.mark.skipif(
    not Path("/proc/self/smaps").exists(), reason="Linux tells how files are mapped"
)
def test_large_lists_are_mapped_so_that_no_more_is_read_than_is_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("index.files.READ_AHEAD_BYTES", 0)
    made_index(tmp_path)
    opened = OpenedIndex(tmp_path)
    opened.parts("hesaff-sift")
    _, _, mapping = (
        Path("/proc/self/smaps")
        .read_text()
        .partition(str(tmp_path / "segments/0001/hesaff-sift/packed.npy"))
    )
    flags = mapping.partition("VmFlags:")[2].partition("\n")[0].split()
    assert "rr" in flags  # random read
