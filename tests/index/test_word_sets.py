"""Words are taken along whole, or not at all."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from made_index import FEATURES, N_WORDS, made_index

from contracts.errors import BadIndex
from index.codebooks import codebooks_digest
from index.files import sha256_of, write_array
from index.importing import import_folder, import_words, words_to_import
from index.manifest import Generation
from index.word_sets import MANIFEST, file_names, open_words

CHANNELS = FEATURES.channels()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Generation]:
    root = tmp_path_factory.mktemp("made")
    return root, made_index(root)


@pytest.fixture
def index(made: tuple[Path, Generation], tmp_path: Path) -> Path:
    return Path(shutil.copytree(made[0], tmp_path / "made"))


@pytest.fixture
def folder(made: tuple[Path, Generation], tmp_path: Path) -> Path:
    import_folder(open_words(made[0]), tmp_path / "words")
    return tmp_path / "words"


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_folder_of_words_is_the_index_s_own_and_says_where_from(
    made: tuple[Path, Generation], folder: Path
) -> None:
    root, generation = made
    there = contents(folder)
    assert json.loads(there.pop(MANIFEST))["origin"]["index"] == str(root)
    assert there == contents(root / "codebooks" / "0001")
    words = open_words(folder).words
    assert words.digest == generation.codebooks_digest
    assert words.config == generation.config
    assert words == open_words(root).words


def test_words_can_be_handed_on_and_stay_the_same(folder: Path, tmp_path: Path) -> None:
    import_folder(open_words(folder), tmp_path / "again")
    assert contents(tmp_path / "again") == contents(folder)


def test_importing_again_changes_nothing_and_mends_what_was_cut(
    made: tuple[Path, Generation], folder: Path
) -> None:
    before = contents(folder)
    (folder / "hesaff-sc.npy").write_bytes(b"cut")
    (folder / MANIFEST).unlink()
    import_folder(open_words(made[0]), folder)
    assert contents(folder) == before


@pytest.mark.parametrize("name", [MANIFEST, "poem.txt"])
def test_a_folder_with_other_things_is_left_alone(
    made: tuple[Path, Generation], tmp_path: Path, name: str
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / name).write_text("{}")
    with pytest.raises(BadIndex, match=name):
        import_folder(open_words(made[0]), out)
    assert contents(out) == {name: b"{}"}


def test_words_of_another_index_are_not_mixed_in(folder: Path, tmp_path: Path) -> None:
    made_index(tmp_path / "other", sizes=(3,), seed=1)
    with pytest.raises(BadIndex, match="holds other words already"):
        import_folder(open_words(tmp_path / "other"), folder)


def test_words_come_to_the_same_place_whoever_copies_them(
    made: tuple[Path, Generation], folder: Path, tmp_path: Path
) -> None:
    root = tmp_path / "new"
    both = [words_to_import(root, open_words(each), CHANNELS) for each in (made[0], folder)]
    assert both[0] == both[1]
    assert both[0].n_words == dict.fromkeys(CHANNELS, N_WORDS)
    assert not root.exists()
    import_words(root, open_words(folder), both[0])
    assert contents(root / "codebooks" / both[0].name) == contents(made[0] / "codebooks" / "0001")


def test_some_channels_have_a_digest_and_a_place_of_their_own(folder: Path, tmp_path: Path) -> None:
    source = open_words(folder)
    some = words_to_import(tmp_path / "new", source, CHANNELS[:1])
    every = words_to_import(tmp_path / "new", source, CHANNELS)
    assert some.name != every.name
    assert some.digest != every.digest == source.words.digest
    import_words(tmp_path / "new", source, some)
    copied = {path.name for path in (tmp_path / "new" / "codebooks" / some.name).iterdir()}
    assert copied == set(file_names(CHANNELS[0]).values())


def test_copying_that_was_interrupted_goes_on(folder: Path, tmp_path: Path) -> None:
    source, root = open_words(folder), tmp_path / "new"
    words = words_to_import(root, source, CHANNELS)
    import_words(root, source, words)
    place = root / "codebooks" / words.name
    whole = contents(place)
    kept = (place / "hesaff-sift.npy").stat().st_mtime_ns
    (place / "hesaff-sc.npy").write_bytes(b"half")
    (place / "hesaff-sc.json").unlink()
    import_words(root, source, words)
    assert contents(place) == whole
    assert (place / "hesaff-sift.npy").stat().st_mtime_ns == kept


def flipped(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))


@pytest.mark.parametrize("name", [name for each in CHANNELS for name in file_names(each).values()])
def test_a_damaged_file_of_words_is_refused_by_name(
    folder: Path, tmp_path: Path, name: str
) -> None:
    source = open_words(folder)
    words = words_to_import(tmp_path / "new", source, CHANNELS)
    flipped(folder / name)
    for take in (
        lambda: words_to_import(tmp_path / "new", source, CHANNELS),
        lambda: import_words(tmp_path / "new", source, words),
        lambda: import_folder(source, tmp_path / "out"),
    ):
        with pytest.raises(BadIndex, match=rf"words/{name} is not the file that was written"):
            take()
    left = [*tmp_path.glob(f"new/**/*{name}*"), *tmp_path.glob(f"out/**/*{name}*")]
    assert left == []


def test_a_source_that_is_neither_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadIndex, match=r"neither codebooks\.json .* nor a finished index"):
        open_words(tmp_path)


def test_an_index_whose_digest_is_not_its_words_is_refused(index: Path) -> None:
    path = index / "generations" / "000001.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "codebooks_digest": "0" * 16}))
    with pytest.raises(BadIndex, match="digest 0000000000000000 is not that of the files"):
        open_words(index)


def hostile(content: dict[str, object], old: str, new: str) -> dict[str, object]:
    files = dict(content["files"])  # type: ignore[call-overload]
    files[new] = files.pop(old)
    return {**content, "files": files}


@pytest.mark.parametrize(
    "name", ["../../etc/passwd", "/etc/passwd", "hesaff-surf.npy", "x" * 10**5]
)
def test_a_name_that_is_no_file_of_the_channels_is_refused(folder: Path, name: str) -> None:
    path = folder / MANIFEST
    path.write_text(json.dumps(hostile(json.loads(path.read_text()), "hesaff-sc.npy", name)))
    with pytest.raises(BadIndex, match=r"codebooks\.json: .*files: ") as refused:
        open_words(folder)
    assert len(str(refused.value)) < 500


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"[]",
        b"[" * 100_000,
        b'{"format_version": 2}',
        b'{"format_version": ' + b"9" * 5000 + b"}",
        b" " * (2 << 20),
        b'{"format_version": 3, "digest": "../../../../.."}',
    ],
)
def test_a_hostile_codebooks_json_is_refused(folder: Path, content: bytes) -> None:
    (folder / MANIFEST).write_bytes(content)
    with pytest.raises(BadIndex, match=r"codebooks\.json"):
        open_words(folder)


def test_words_of_another_width_are_refused(folder: Path, tmp_path: Path) -> None:
    path = folder / "hesaff-sc.npy"
    write_array(path, np.zeros((N_WORDS, 8), dtype=np.uint8))
    content = json.loads((folder / MANIFEST).read_text())
    content["files"][path.name] = {"sha256": sha256_of(path), "size": path.stat().st_size}
    digests = {each: content["files"][f"{each}.npy"]["sha256"] for each in CHANNELS}
    content["digest"] = codebooks_digest(digests)
    (folder / MANIFEST).write_text(json.dumps(content))
    with pytest.raises(BadIndex, match=r"words of hesaff-sc in .* 8 dimensions, expected 36"):
        words_to_import(tmp_path / "new", open_words(folder), CHANNELS)
