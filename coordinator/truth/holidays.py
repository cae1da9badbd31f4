"""The ground truth of INRIA Holidays (Jégou, Douze, Schmid, ECCV 2008).

The evaluation package has it in two forms. `holidays_images.dat` lists an image a line: number
divisible by 100 = a query, the others of the same hundred are relevant. `perfect_result.dat` has
a line a query: its image, then rank and image of each relevant one.
"""

import re
from pathlib import Path

from contracts.errors import BadTruth
from coordinator.truth.written import WrittenQuery, filled_lines

_IMAGE = re.compile(r"(?:.*/)?(\d+)\.[A-Za-z]\w*")


def is_holidays(content: bytes) -> bool:
    """Whether a file begins with the name of a numbered image."""
    first = content.removeprefix(b"\xef\xbb\xbf").lstrip().split(b"\n", 1)[0]
    line = first.decode("utf-8", "replace").strip()
    return any(_IMAGE.fullmatch(start) for start in (line, *line.split(maxsplit=1)[:1]))


def read_holidays(path: Path, text: str) -> list[WrittenQuery]:
    """Read either form; queries are in the order of the file.

    Raises
    ------
    BadTruth : a line that is neither, an image whose query is missing, a query that is there
        twice, or a result that is not of its query's hundred.
    """
    lines = [(number, _parsed(path, number, line)) for number, line in filled_lines(text)]
    if any(len(images) > 1 for _, images in lines):
        return _from_results(path, lines)
    return _from_list(path, [images[0] for _, images in lines])


def _parsed(path: Path, number: int, line: str) -> list[str]:
    images = _images_of(line)
    if not images:
        raise BadTruth(
            f"Line {number} of {path} is {line!r}; expected a numbered image such as 100000.jpg, "
            "or a query with ranks and images such as '100000.jpg 0 100001.jpg 1 100002.jpg'."
        )
    return images


def _images_of(line: str) -> list[str]:
    """The one image of a list's line, query and results of a result line, or nothing."""
    fields = line.split()
    images, ranks = fields[::2], fields[1::2]
    if (
        len(images) == len(ranks) + 1
        and all(rank.isdecimal() for rank in ranks)
        and all(map(_IMAGE.fullmatch, images))
    ):
        return images
    return [line] if _IMAGE.fullmatch(line) else []


def _from_list(path: Path, images: list[str]) -> list[WrittenQuery]:
    queries = {_number(image) // 100: image for image in images if _number(image) % 100 == 0}
    relevant: dict[int, list[str]] = {hundred: [] for hundred in queries}
    for image in images:
        number = _number(image)
        if number // 100 not in queries:
            raise BadTruth(
                f"{path} lists {image} without its query, number {number // 100 * 100}. "
                "Add the query or remove the image."
            )
        if number % 100:
            relevant[number // 100].append(image)
    return [
        WrittenQuery(image, image, tuple(relevant[hundred])) for hundred, image in queries.items()
    ]


def _from_results(path: Path, lines: list[tuple[int, list[str]]]) -> list[WrittenQuery]:
    queries: dict[str, WrittenQuery] = {}
    for number, (query, *results) in lines:
        if query in queries:
            raise BadTruth(f"Line {number} of {path} has {query} a second time; remove one line.")
        hundred = _number(query)
        wrong = [image for image in results if _number(image) // 100 * 100 != hundred]
        if hundred % 100 or wrong:
            names = f"{query} with {wrong[0]}" if wrong else query
            raise BadTruth(
                f"Line {number} of {path} has {names}, which is no ground truth: a query's number "
                "is divisible by 100 and its images are of the same hundred. Is it the result of "
                "a search? Give perfect_result.dat or holidays_images.dat."
            )
        relevant = tuple(image for image in results if _number(image) != hundred)
        queries[query] = WrittenQuery(query, query, relevant)
    return list(queries.values())


def _number(image: str) -> int:
    return int(image.rsplit("/", 1)[-1].split(".", 1)[0])
