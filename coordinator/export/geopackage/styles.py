"""How QGIS draws the layers: the table `layer_styles`, which it reads when it opens the file.

Each layer has a template in `qml/`, a style as QGIS stores it reduced to what differs from the
defaults; `{{name}}` is filled in here. Ranks have the same colours in every layer.
"""

import importlib.resources
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from xml.sax.saxutils import escape, quoteattr

import pyarrow as pa

from coordinator.export.columns import GEOMETRY
from coordinator.export.geopackage.layers import Layer

MANY_QUERIES = 6
"""From so many on, numbers, views and links are drawn on near maps only, and of the best ranks."""
_NEAR_SCALE = 6_000
_ANY_SCALE = _ANY_RANK = 1_000_000_000
_BEST_RANKS = {"links": 1, "views": 1}
"""Of many queries: the last rank that is drawn; the classes below can be ticked in QGIS."""


@dataclass(frozen=True, slots=True)
class _RankClass:
    """Ranks drawn alike: `fill` and `ink` (the number on it), red,green,blue."""

    first: int
    last: int
    label: str
    fill: str
    ink: str


# ColorBrewer's six-class OrRd: from the best, dark, to the last, pale; safe for colour-blind eyes.
_RANKS = (
    _RankClass(1, 1, "1, the best", "179,0,0", "255,255,255"),
    _RankClass(2, 3, "2 to 3", "227,74,51", "255,255,255"),
    _RankClass(4, 5, "4 to 5", "252,141,89", "40,20,10"),
    _RankClass(6, 10, "6 to 10", "253,187,132", "40,20,10"),
    _RankClass(11, 50, "11 to 50", "253,212,158", "40,20,10"),
    _RankClass(51, _ANY_RANK, "above 50", "254,240,217", "40,20,10"),
)


def style_table(layers: Sequence[Layer], n_queries: int) -> pa.Table:
    """One default style a layer, as QGIS stores them."""
    now = datetime.now(UTC)
    rows = [
        {
            "f_table_catalog": "",
            "f_table_schema": "",
            "f_table_name": layer.name,
            "f_geometry_column": GEOMETRY,
            "styleName": "Flaneur",
            "styleQML": style_qml(layer, n_queries),
            "styleSLD": "",
            "useAsDefault": True,
            "description": layer.description,
            "owner": "",
            "ui": None,
            "update_time": now,
        }
        for layer in layers
    ]
    types = {"useAsDefault": pa.bool_(), "update_time": pa.timestamp("ms", tz="UTC")}
    names = [(name, types.get(name, pa.string())) for name in rows[0]]
    return pa.Table.from_pylist(rows, schema=pa.schema(names))


def style_qml(layer: Layer, n_queries: int) -> str:
    """The QML text of a layer's style.

    n_queries : how crowded the map is; see `MANY_QUERIES`.
    """
    many = n_queries >= MANY_QUERIES
    last_drawn = _BEST_RANKS.get(layer.name, _ANY_RANK) if many else _ANY_RANK
    parts = {
        "near_scale": str(_NEAR_SCALE if many else _ANY_SCALE),
        "area_opacity": "20" if many else "45",
        "aliases": "".join(
            f"<alias index={quoteattr(str(number))} field={quoteattr(column.name)} "
            f"name={quoteattr(column.alias)}/>"
            for number, column in enumerate(layer.columns, 1)  # 0 is the key
        ),
        "rank_ranges": "".join(
            f'<range symbol="{number}" render="{str(each.first <= last_drawn).lower()}" '
            f'lower="{each.first}" upper="{each.last}" label={quoteattr(each.label)}/>'
            for number, each in enumerate(_RANKS)
        ),
    }
    template = _template(f"{layer.name}.qml")
    if "{{rank_symbols}}" in template:
        symbol = _template(f"{layer.name}-symbol.qml")
        parts["rank_symbols"] = "".join(
            _filled(symbol, {**parts, "number": str(n), "fill": each.fill, "ink": each.ink})
            for n, each in enumerate(_RANKS)
        )
    if "{{map_tip}}" in template:
        parts["map_tip"] = escape(_template(f"{layer.name}-tip.html"))
    return _filled(template, parts)


def _filled(template: str, parts: Mapping[str, str]) -> str:
    return re.sub(r"\{\{(\w+)\}\}", lambda slot: parts[slot.group(1)], template)


def _template(name: str) -> str:
    folder = importlib.resources.files("coordinator.export.geopackage").joinpath("qml")
    return folder.joinpath(name).read_text("utf-8")
