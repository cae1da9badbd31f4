"""Receipts: what counts as done."""

from pathlib import Path

import pytest

from contracts.errors import TaskFailed
from contracts.records import Pose, PosedImage, Receipt
from index.files import write_bytes
from index.jobs import JobFolder

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


def test_shard_lists_come_back_as_written(tmp_path: Path) -> None:
    from contracts.config import IndexConfig
    from index.jobs import JobPlan

    job = JobFolder(tmp_path, JOB)
    images = [
        PosedImage("été/1.jpg", "/s/été/1.jpg", Pose(1.5, 2.5, "EPSG:2154", heading_deg=7.0)),
        PosedImage("b.png", "/s/b.png", quarter_turns=2, mask_path="/s/m.png"),
    ]
    config = IndexConfig()
    plan = JobPlan(
        job=JOB,
        config=config,
        config_digest=config.digest(),
        segment="0001",
        n_images=2,
        shard_size=1,
        n_shards=2,
    )
    job.write_plan(plan, [images[:1], images[1:]])
    assert job.read_plan() == plan
    assert job.read_images(0) + job.read_images(1) == images
