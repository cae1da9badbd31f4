"""Receipts: what counts as done."""

import json
import os
from pathlib import Path

import pytest

from contracts.config import IndexConfig
from contracts.errors import BadIndex, TaskFailed
from contracts.records import Pose, PosedImage, Receipt
from index.files import write_bytes
from index.jobs import IndexedImage, JobFolder, JobPlan

JOB = "0123456789abcdef"


def with_receipt(root: Path) -> tuple[JobFolder, Path, Receipt]:
    job = JobFolder(root, JOB)
    path = job.features(3)
    digest = write_bytes(path, b"features")
    receipt = Receipt("extract", "000003", {job.relative(path): digest}, {"images": 2})
    job.write_receipt(receipt)
    return job, path, receipt


def test_a_receipt_counts_while_its_files_are_what_they_were(tmp_path: Path) -> None:
    job, path, receipt = with_receipt(tmp_path)
    assert job.valid_receipt("extract", "000003") == receipt
    path.write_bytes(b"Features")
    assert job.valid_receipt("extract", "000003") is None
    path.unlink()
    assert job.valid_receipt("extract", "000003") is None


def test_leftovers_without_a_receipt_do_not_count(tmp_path: Path) -> None:
    job = JobFolder(tmp_path, JOB)
    write_bytes(job.features(3), b"features")
    assert job.valid_receipt("extract", "000003") is None


def test_a_torn_receipt_does_not_count(tmp_path: Path) -> None:
    job, _, _ = with_receipt(tmp_path)
    path = job.receipt_path("extract", "000003")
    path.write_bytes(path.read_bytes()[:-9])
    assert job.valid_receipt("extract", "000003") is None


@pytest.mark.parametrize("name", ["../../../etc", "0123", "0123456789ABCDEF", ""])
def test_a_job_id_cannot_name_another_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(TaskFailed, match="not the id of a job"):
        JobFolder(tmp_path, name)


def test_a_receipt_that_names_a_file_elsewhere_does_not_count(tmp_path: Path) -> None:
    job = JobFolder(tmp_path / "index", JOB)
    digest = write_bytes(tmp_path / "elsewhere", b"features")
    for name in ("../elsewhere", str(tmp_path / "elsewhere")):
        job.write_receipt(Receipt("extract", "000003", {name: digest}, {"images": 2}))
        assert job.read_receipt("extract", "000003") is not None
        assert job.valid_receipt("extract", "000003") is None


def planned(root: Path) -> tuple[JobFolder, JobPlan]:
    job, config = JobFolder(root, JOB), IndexConfig()
    plan = JobPlan(
        job=JOB,
        verb="index",
        config=config,
        config_digest=config.digest(),
        segment="0001",
        codebooks="0001",
        trains=True,
        n_images=2,
        shard_size=1,
        n_shards=2,
    )
    job.write_plan(plan, [IMAGES[:1], IMAGES[1:]])
    return job, plan


IMAGES = [
    PosedImage("été/1.jpg", "/s/été/1.jpg", Pose(1.5, 2.5, "EPSG:2154", heading_deg=7.0)),
    PosedImage("b.png", "/s/b.png", quarter_turns=2, mask_path="/s/m.png"),
]


def test_plan_and_lists_come_back_as_written(tmp_path: Path) -> None:
    job, plan = planned(tmp_path)
    indexed = [IndexedImage(0, "0" * 64, 640, 480)]
    job.write_indexed(0, indexed)
    assert job.read_plan() == plan
    assert job.read_images(0) + job.read_images(1) == IMAGES
    assert job.read_indexed(0) == indexed


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("segment", "../../elsewhere"),
        ("codebooks", "/etc"),
        ("compacts", ["0001", ".."]),
        ("job", "f" * 16),
        ("n_shards", "many"),
        ("verb", "format"),
        ("surprise", 1),
    ],
)
def test_an_edited_plan_is_refused_by_name(tmp_path: Path, key: str, value: object) -> None:
    job, _ = planned(tmp_path)
    path = job.path / "plan.json"
    path.write_text(json.dumps({**json.loads(path.read_bytes()), key: value}))
    with pytest.raises(BadIndex, match=r"plan\.json .*Remove the folder .* run the same command"):
        job.read_plan()


@pytest.mark.parametrize("content", [b"", b"{", b"[" * 1_000_000, b"[1]", b"\xff\xfe", b"null"])
def test_what_is_no_plan_or_list_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    job, _ = planned(tmp_path)
    paths = {
        job.path / "plan.json": job.read_plan,
        job.images_of_shard(0): lambda: job.read_images(0),
        job.indexed_of_shard(0): lambda: job.read_indexed(0),
    }
    for path, read in paths.items():
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
        with pytest.raises(BadIndex, match=f"{path.name} is damaged .*Remove the folder"):
            read()


def test_a_missing_list_and_one_that_is_no_file_are_told(tmp_path: Path) -> None:
    job, _ = planned(tmp_path)
    job.images_of_shard(0).unlink()
    os.mkfifo(job.images_of_shard(0))
    with pytest.raises(BadIndex, match="Not a regular file"):
        job.read_images(0)
    with pytest.raises(BadIndex, match=r"No such file .*Workers must see the index"):
        job.read_indexed(1)
