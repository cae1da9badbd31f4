"""The state of an index is told as it is, and looking changes nothing."""

import shutil
from contextlib import nullcontext
from pathlib import Path

import pytest
from made_index import FEATURES, N_WORDS, made_index, named_anew
from typer.testing import CliRunner

from contracts.config import IndexConfig
from contracts.errors import BadIndex
from contracts.records import Receipt
from coordinator.cli import main
from coordinator.cli.tables import aligned
from coordinator.pruning import prune
from coordinator.status import MANY_SEGMENTS, state_of
from index.commits import working
from index.jobs import JobFolder, JobPlan
from index.manifest import Generation


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Generation]:
    root = tmp_path_factory.mktemp("made")
    return root, made_index(root, removed=(1,))


@pytest.fixture
def index(made: tuple[Path, Generation], tmp_path: Path) -> tuple[Path, Generation]:
    return shutil.copytree(made[0], tmp_path / "index"), made[1]


def begun_job(root: Path, job_id: str = "ab" * 8) -> JobFolder:
    """A job of three shards, two of them extracted."""
    job = JobFolder(root, job_id)
    config = IndexConfig(features=FEATURES)
    plan = JobPlan(
        job=job.job,
        verb="index",
        config=config,
        config_digest=config.digest(),
        segment="0099",
        codebooks="0099",
        trains=True,
        n_images=5,
        shard_size=2,
        n_shards=3,
    )
    job.write_plan(plan, ())
    for shard in (0, 1):
        job.write_receipt(Receipt("extract", f"{shard:06d}", {}, {}))
    return job


def everything_in(root: Path) -> dict[str, tuple[int, int]]:
    files = (path for path in root.rglob("*") if path.is_file())
    return {str(path): (path.stat().st_size, path.stat().st_mtime_ns) for path in files}


def test_what_is_live_is_counted_by_segments_and_channels(index: tuple[Path, Generation]) -> None:
    root, generation = index
    before = everything_in(root)
    state = state_of(root)
    assert everything_in(root) == before
    assert (state.live, state.faults, state.hints, state.jobs) == (1, (), (), ())
    assert [(each.images, each.removed) for each in state.segments] == [(5, 1), (4, 0)]
    assert sum(each.postings for each in state.segments) == generation.n_postings
    files = [path for path in (root / "segments" / "0001").rglob("*") if path.is_file()]
    assert state.segments[0].bytes == sum(path.stat().st_size for path in files)
    assert [(each.channel, each.words) for each in state.codebooks] == [
        (channel, N_WORDS) for channel in FEATURES.channels()
    ]
    assert state.bytes == sum(size for size, _ in before.values())


def test_a_damaged_live_generation_is_a_fault_and_exit_2(index: tuple[Path, Generation]) -> None:
    root, _ = index
    (root / "codebooks" / "0001" / "hesaff-sc.npy").unlink()
    (fault,) = state_of(root).faults
    assert "hesaff-sc.npy is missing" in fault
    told = CliRunner().invoke(main, ["status", str(root)])
    assert told.exit_code == 2
    assert "damaged" in told.stdout


def test_a_damaged_former_generation_is_no_fault_of_the_index(
    index: tuple[Path, Generation],
) -> None:
    root, generation = index
    files = {name: each for name, each in generation.files.items() if "removed" not in name}
    named_anew(root, generation.model_copy(update={"files": files}))
    (root / "tombstones" / "000001" / "0001" / "removed.npy").unlink()
    state = state_of(root)
    assert state.faults == ()
    assert [bool(each.faults) for each in state.generations] == [True, False]
    (root / "generations" / "000001.json").write_text("{")
    assert CliRunner().invoke(main, ["status", str(root)]).exit_code == 0
    assert "000001.json" in state_of(root).hints[0]


@pytest.mark.parametrize("text", ["nonsense", "000007"])
def test_a_current_that_names_nothing_is_a_fault(index: tuple[Path, Generation], text: str) -> None:
    (index[0] / "CURRENT").write_text(text)
    state = state_of(index[0])
    assert state.live is None
    assert len(state.faults) == 1
    assert [each.number for each in state.generations] == [1]


def test_an_unfinished_index_has_only_jobs(tmp_path: Path) -> None:
    job = begun_job(tmp_path)
    state = state_of(tmp_path)
    assert (state.live, state.generations, state.faults) == (None, (), ())
    (told,) = state.jobs
    assert (told.shards, told.channels, told.at_work) == (3, 2, False)
    assert told.done == {"extract": 2, "train": 0, "assign": 0, "merge": 0, "join": 0}
    with working(job):
        assert state_of(tmp_path).jobs[0].at_work is True
    told_all = CliRunner().invoke(main, ["status", str(tmp_path)])
    assert told_all.exit_code == 0
    assert "2 of 3" in told_all.stdout


def test_a_job_without_a_plan_and_one_with_a_damaged_plan_are_told(tmp_path: Path) -> None:
    JobFolder(tmp_path, "cd" * 8).write_receipt(Receipt("train", "hesaff-sift", {}, {}))
    (begun_job(tmp_path).path / "plan.json").write_text("{")
    damaged, unplanned = state_of(tmp_path).jobs
    assert damaged.fault is not None
    assert "plan.json" in damaged.fault
    assert (unplanned.fault, unplanned.shards, unplanned.done["train"]) == (None, None, 1)


def test_a_job_that_made_a_live_segment_is_finished(index: tuple[Path, Generation]) -> None:
    root, generation = index
    begun_job(root, generation.segments[0].jobs[0])
    assert state_of(root).jobs == ()


@pytest.mark.parametrize("at_work", [True, False])
def test_what_is_told_to_be_unneeded_is_what_pruning_frees(
    index: tuple[Path, Generation], at_work: bool
) -> None:
    root, generation = index
    job = begun_job(root)
    (root / "segments" / "0099").mkdir()
    (root / "segments" / "0099" / "half.npy").write_bytes(bytes(1000))
    (root / "note.txt").write_text("not ours")
    kept = {name: each for name, each in generation.files.items() if "tombstones" not in name}
    first = generation.segments[0].model_copy(update={"n_removed": 0, "tombstones": None})
    segments = (first, *generation.segments[1:])
    named_anew(root, generation.model_copy(update={"files": kept, "segments": segments}))
    with working(job) if at_work else nullcontext():
        before = state_of(root)
        pruned = prune(root)
        after = state_of(root)
    assert before.bytes_unneeded == pruned.n_bytes > 0
    assert before.bytes - after.bytes == pruned.n_bytes
    assert after.bytes_unneeded == 0
    assert after.faults == ()
    assert (root / "segments" / "0099").exists() == at_work == bool(after.jobs)
    assert (root / "note.txt").exists()


def test_compacting_is_advised_where_it_pays(tmp_path: Path) -> None:
    made_index(tmp_path / "many", sizes=(1,) * (MANY_SEGMENTS + 1))
    assert f"{MANY_SEGMENTS + 1} segments" in state_of(tmp_path / "many").hints[0]
    made_index(tmp_path / "holes", sizes=(8,), removed=(0, 1))
    assert "25% of the images are removed" in state_of(tmp_path / "holes").hints[0]


def test_a_folder_that_is_no_index_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadIndex, match="is not a Flaneur index"):
        state_of(tmp_path)


def test_different_instruction_sets_are_told(index: tuple[Path, Generation]) -> None:
    root, generation = index
    for segment, name in zip(generation.segments, ("AVX2", "AVX512"), strict=True):
        receipt = Receipt("extract", "000000", {}, {}, instruction_set=name)
        JobFolder(root, segment.jobs[0]).write_receipt(receipt)
    assert state_of(root).instruction_sets == ("AVX2", "AVX512")
    assert "AVX2; AVX512" in CliRunner().invoke(main, ["status", str(root)]).stdout


def test_names_of_any_width_stay_in_their_columns() -> None:
    rows = [("name", "n"), ("rue Édouard", "1"), ("京都", "2000")]
    assert aligned(rows, (False, True)) == [
        "name            n",
        "rue Édouard     1",
        "京都         2000",
    ]


def test_a_name_that_would_command_the_terminal_is_shown_harmless(
    index: tuple[Path, Generation],
) -> None:
    root, generation = index
    first, second = generation.segments
    survey = first.surveys[0].model_copy(update={"name": "\x1b[2Jgone"})
    segments = (first.model_copy(update={"surveys": (survey,)}), second)
    named_anew(root, generation, segments=segments)
    told = CliRunner().invoke(main, ["status", str(root)])
    assert "\x1b" not in told.stdout
    assert "[2Jgone" in told.stdout
