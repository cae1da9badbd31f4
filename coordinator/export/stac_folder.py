"""A static STAC catalogue on disk, written folder by folder, that any client can walk.

DIR/collection.json leads to DIR/0000/catalog.json and so on, each to at most a thousand items.
"""

import json
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from contracts.config import Where
from contracts.errors import WrongInput
from coordinator.export.attribution import attributions
from coordinator.export.stac import JSON_TYPE, STAC_VERSION, ItemMaker, Json
from geo.bounds import Bounds
from index.manifest import Generation
from index.opened import OpenedIndex
from index.selecting import candidates
from workers.stages.spots import ground_of

GROUP = 1000
"""Items a folder: a client that walks the catalogue reads one such list at a time."""
WHOLE_EARTH = [-180.0, -90.0, 180.0, 90.0]


def write_stac(index: OpenedIndex, folder: Path, advance: Callable[[], None]) -> None:
    """Write every live image of an index as a STAC item; the folder is there whole or not at all.

    Parameters
    ----------
    folder : new, or empty.
    advance : called once an image.

    Raises
    ------
    WrongInput : `folder` has something in it, or cannot be written.
    """
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise WrongInput(f"{folder} is there already; name a new folder for the catalogue.")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name[:50]}."))
        try:
            _write_into(beside, index, advance)
            beside.chmod(0o755)
            beside.replace(folder)
        except BaseException:
            shutil.rmtree(beside, ignore_errors=True)
            raise
    except OSError as error:
        raise WrongInput(
            f"cannot write {folder}: {error.strerror}; name a folder where there is room and "
            "leave to write"
        ) from error


def _write_into(folder: Path, index: OpenedIndex, advance: Callable[[], None]) -> None:
    generation = index.generation
    collection_id = f"flaneur-{generation.digest()}"
    maker = ItemMaker(collection_id, generation.crs, ground_of(index), generation.created_at)
    extent, groups = _Extent(), []
    live = candidates(index, Where()).ids
    for begin in range(0, len(live), GROUP):
        name = f"{begin // GROUP:04d}"
        (folder / name).mkdir()
        rows = index.catalogue.rows(live[begin : begin + GROUP])
        names = []
        for item in maker.items(rows):
            _write(folder / name / f"{item['id']}.json", item)
            extent.add(item)
            names.append(item["id"])
            advance()
        _write(folder / name / "catalog.json", _group(collection_id, name, names))
        groups.append(name)
    _write(folder / "collection.json", _collection(collection_id, generation, extent, groups))


class _Extent:
    """What a collection spans in space and time, noted as its items go by."""

    def __init__(self) -> None:
        self._bounds = Bounds()
        self._times: list[str] = []

    def add(self, item: Json) -> None:
        if item["geometry"] is not None:
            self._bounds.add(item["geometry"]["coordinates"])
        properties = item["properties"]
        moment = properties["datetime"]
        begin = moment or properties["start_datetime"]
        end = moment or properties["end_datetime"]
        # All as `utc_time` writes them, so that their texts are in the order of time.
        self._times = [min([begin, *self._times]), max([end, *self._times])]

    def described(self) -> Json:
        return {
            "spatial": {"bbox": [self._bounds.bbox() or WHOLE_EARTH]},
            "temporal": {"interval": [self._times or [None, None]]},
        }


def _collection(
    collection_id: str, generation: Generation, extent: _Extent, groups: list[str]
) -> Json:
    surveys = ", ".join(Path(survey.path).name for survey in generation.surveys)
    collection: Json = {
        "type": "Collection",
        "stac_version": STAC_VERSION,
        "id": collection_id,
        "title": surveys or collection_id,
        "description": f"{generation.n_live} street-level images indexed by Flaneur, "
        f"generation {generation.number}.",
        "license": "other",
        "extent": extent.described(),
        "links": [
            {"rel": "root", "href": "./collection.json", "type": JSON_TYPE},
            *(
                {"rel": "child", "href": f"./{name}/catalog.json", "type": JSON_TYPE}
                for name in groups
            ),
        ],
    }
    providers = [{"name": each, "roles": ["producer"]} for each in attributions(generation)]
    return {**collection, "providers": providers} if providers else collection


def _group(collection_id: str, name: str, items: list[str]) -> Json:
    return {
        "type": "Catalog",
        "stac_version": STAC_VERSION,
        "id": f"{collection_id}-{name}",
        "description": f"{len(items)} images of {collection_id}",
        "links": [
            {"rel": "root", "href": "../collection.json", "type": JSON_TYPE},
            {"rel": "parent", "href": "../collection.json", "type": JSON_TYPE},
            *(
                {"rel": "item", "href": f"./{item}.json", "type": "application/geo+json"}
                for item in items
            ),
        ],
    }


def _write(path: Path, content: Json) -> None:
    path.write_text(json.dumps(content, allow_nan=False), encoding="ascii")
