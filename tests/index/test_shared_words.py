"""The words of a codebook are read in place: no process has a copy of its own."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from contracts.config import MAX_NEIGHBOURS
from index import codebooks
from index.codebooks import codebook_paths, read_searcher, write_codebook
from retrieval.codebooks import Codebook
from retrieval.word_search import one_list

N_WORDS = 200_000
SEARCH = """
import sys
from pathlib import Path
import numpy as np
from index.codebooks import codebook_paths, read_searcher
from retrieval.word_search import compile_word_search

def own_bytes():
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("RssAnon:")).split()[1])

compile_word_search()
before = own_bytes()
searcher = read_searcher(codebook_paths(Path(sys.argv[1]), "0001", "hesaff-sift"), sys.argv[2])
found, _ = searcher.nearest(searcher.codebook.words[::20_000], 1)
assert found[:, 0].tolist() == list(range(0, len(searcher.codebook.words), 20_000))
print(own_bytes() - before)
"""


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, str]:
    """A codebook on disk, and the digest of its search structure: all words in one list."""
    monkeypatch.setattr(codebooks, "build_search", one_list)
    words = np.random.default_rng(0).integers(0, 256, (N_WORDS, 128), dtype=np.uint8)
    far = np.ones(MAX_NEIGHBOURS, np.float32)
    paths = codebook_paths(tmp_path, "0001", "hesaff-sift")
    return tmp_path, write_codebook(paths, Codebook(words, 0.0, far, far))[paths["search"]]


def test_a_process_that_searches_all_words_holds_none_of_them(written: tuple[Path, str]) -> None:
    root, digest = written
    command = [sys.executable, "-c", SEARCH, str(root), digest]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=120, check=True
    )
    assert int(done.stdout) < N_WORDS * 128 / 2


def test_a_search_structure_is_read_and_not_made_again(
    written: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(_: object) -> None:
        raise AssertionError("lists are made when a codebook is written")

    root, digest = written
    monkeypatch.setattr(codebooks, "build_search", refused)
    monkeypatch.setattr("retrieval.word_search.lists_around", refused)
    read_searcher(codebook_paths(root, "0001", "hesaff-sift"), digest)
