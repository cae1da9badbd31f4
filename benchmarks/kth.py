"""KTH: 50 facades of Stockholm from another day and viewpoint, with all other sets as distractors.

The rows are named options, not a search for the best: nothing is tuned on these queries.
"""

import tempfile
from contextlib import nullcontext
from pathlib import Path

from benchmarks.table import print_table
from contracts.config import IndexConfig, SearchConfig
from coordinator.cli.show import bars
from coordinator.engine.running import running_engine
from coordinator.evaluating import report_of
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from coordinator.querying import judge_queries
from coordinator.truth import read_truth
from index.opened import OpenedIndex
from survey import ReadOptions

DISTRACTORS = ("wxbs", "budaors", "stereopolis-paris6", "san-francisco-toy", "gps-photos")
SEARCHES = {
    "auto": SearchConfig(),
    "hesaff-star, k = 2": SearchConfig(pair=("hesaff", "star"), k=2),
    "hesaff-mser, k = 2": SearchConfig(pair=("hesaff", "mser"), k=2),
    "hesaff-star, k = 2, union": SearchConfig(pair=("hesaff", "star"), k=2, vote="union"),
    "hesaff-star, k = 2, union, unweighted": SearchConfig(
        pair=("hesaff", "star"), k=2, vote="union", weights=()
    ),
    "hesaff, k = 2": SearchConfig(pair=("hesaff",), k=2),
}


def run(data: Path) -> None:
    """Index references and distractors without poses, and print a row a search."""
    kth = data / "kth-buildings"
    sources = [("", kth / "references"), *((name, data / name) for name in DISTRACTORS)]
    with tempfile.TemporaryDirectory() as scratch, running_engine(None, None) as engine:
        root = Path(scratch)
        intake = read_surveys(sources, ReadOptions(no_pose=True))
        job, plan = make_plan(root, intake, IndexConfig())
        with bars() as progress:
            report = run_job(job, plan, intake, nullcontext(engine), progress)
        index = OpenedIndex(root)
        queries = read_truth(kth / "ground_truth.json", None, index.catalogue.column("uri"))
        rows = []
        for name, search in SEARCHES.items():
            answers = judge_queries(index, queries, search, engine.follower, lambda: None)
            scores = report_of(answers, index, search)
            rows.append(
                (
                    name,
                    *(f"{scores[key]:.3f}" for key in ("mAP", "mAP@10", "R@1", "R@10", "MRR")),
                    f"{scores['seconds_per_query']:.2f}",
                )
            )
    n_images = report.generation.n_images
    print(
        f"{n_images} images, {report.images_extracted / report.seconds:.2f} images/s with "
        f"{engine.n_workers} workers, {report.bytes_on_disk / n_images:,.0f} bytes an image"
    )
    print_table(("search", "mAP", "mAP@10", "R@1", "R@10", "MRR", "s a query"), rows)
