"""How sure estimates are, and the shipped model of it: `python -m benchmarks placing`.

Indices and answers are left in `benchmarks-out/placing` (and those of the real sets in
`benchmarks-out/sets`); what is there is not made again. The first run takes half an hour, and the
real sets an hour if `python -m benchmarks sets` was never run.
"""

from pathlib import Path

from benchmarks.placing.answers import Placed, placed_photos, standings
from benchmarks.placing.fit import fit_placing
from benchmarks.placing.photos import real_sets, stereopolis, towns
from benchmarks.placing.report import (
    Tested,
    plot,
    print_coverage,
    print_targets,
    print_telling_apart,
    print_with_and_without,
)
from benchmarks.sets.collections import SEEDS
from coordinator.engine.running import running_engine
from geo.confidence import PlacingModel

REPOSITORY = Path(__file__).parents[2]
OUT = REPOSITORY / "benchmarks-out" / "placing"
SHIPPED = REPOSITORY / "index" / "default_placing.json"
PLOT = REPOSITORY / "docs" / "decisions" / "0013-reliability.png"


def run(data: Path) -> None:
    """Fit on towns, each tested on a model of the other two; then test on what is real.

    The model is fitted on indices made by default; crowded ones are tested on alone.
    """
    kept = OUT / "answers"
    with running_engine(None, None) as engine:
        indexed = [
            placed_photos(asked, kept / f"{asked.name}.json") for asked in towns(OUT, engine)
        ]
        streets = [
            placed_photos(asked, kept / f"{asked.name}.json")
            for asked in stereopolis(data, OUT, engine)
        ]
        real = standings(*real_sets(data, engine), kept / "real sets.json")
    by_town, crowded = indexed[: len(SEEDS)], indexed[len(SEEDS) :]
    model = fit_placing([answer for answers in by_town for answer in answers])
    without = [fit_placing(_others(by_town, answers)) for answers in by_town]
    tests: list[Tested] = [
        *_tested(by_town, without),
        *_tested(streets, [model] * len(streets)),
        *_tested(crowded, without),
    ]
    print_coverage(tests)
    print()
    print_telling_apart(tests)
    print()
    print_with_and_without(real, model)
    print()
    print_targets(tests)
    plot(PLOT, tests, real)
    SHIPPED.write_text(model.to_json() + "\n", encoding="utf-8")
    print(f"\nShipped {SHIPPED.name}; said to be in from confidence {model.least_confidence:.2f}")


def _tested(sets: list[list[Placed]], models: list[PlacingModel]) -> list[Tested]:
    return [(answers[0].index, answers, model) for answers, model in zip(sets, models, strict=True)]


def _others(by_town: list[list[Placed]], left_out: list[Placed]) -> list[Placed]:
    return [answer for answers in by_town if answers is not left_out for answer in answers]
