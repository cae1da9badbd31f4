"""The styles themselves; what QGIS makes of them is in `tests/integration/test_qgis_opens.py`."""

import re
from xml.etree import ElementTree as ET

import pytest

from coordinator.export.geopackage.layers import LAYERS, Layer
from coordinator.export.geopackage.styles import MANY_QUERIES, style_qml, style_table

by_name = pytest.mark.parametrize("layer", LAYERS, ids=lambda layer: layer.name)
one_and_many = pytest.mark.parametrize("n_queries", [0, 1, MANY_QUERIES, 50])


def parsed(layer: Layer, n_queries: int = 1) -> ET.Element:
    return ET.fromstring(style_qml(layer, n_queries))  # noqa: S314 - our own


@by_name
@one_and_many
def test_styles_are_xml_with_nothing_left_to_fill_in(layer: Layer, n_queries: int) -> None:
    assert parsed(layer, n_queries).tag == "qgis"
    assert "{{" not in style_qml(layer, n_queries)


@by_name
def test_expressions_name_columns_that_are_there(layer: Layer) -> None:
    style = parsed(layer)
    texts = [
        style.findtext("mapTip", ""),
        *(each.get("value", "") for each in style.iter("Option")),
    ]
    texts += [each.get("fieldName", "") for each in style.iter("text-style")]
    texts += [each.text or "" for each in style.iter("orderByClause")]
    # Attributes of the map tip's HTML are in double quotes too, but after an equals sign.
    named = {name for text in texts for name in re.findall(r'(?<!=)"([a-z_0-9]+)"', text)}
    assert named
    assert named <= {column.name for column in layer.columns}
    attribute = style.find("renderer-v2").get("attr")  # type: ignore[union-attr]
    assert attribute is None or attribute in {column.name for column in layer.columns}


@by_name
def test_aliases_count_the_key_as_the_first_field(layer: Layer) -> None:
    aliases = [
        (int(alias.attrib["index"]), alias.attrib["field"], alias.attrib["name"])
        for alias in parsed(layer).iter("alias")
    ]
    assert aliases == [
        (number, column.name, column.alias) for number, column in enumerate(layer.columns, 1)
    ]
    assert len({column.alias for column in layer.columns}) == len(layer.columns)


def test_classes_of_ranks_leave_no_rank_out() -> None:
    (matches,) = (layer for layer in LAYERS if layer.name == "matches")
    ranges = [
        (int(each.attrib["lower"]), int(each.attrib["upper"]))
        for each in parsed(matches).iter("range")
    ]
    assert ranges[0][0] == 1
    assert [low for low, _ in ranges[1:]] == [high + 1 for _, high in ranges[:-1]]


@pytest.mark.parametrize(("n_queries", "drawn"), [(1, "true"), (50, "false")])
def test_views_of_many_photos_are_those_of_the_best_matches(n_queries: int, drawn: str) -> None:
    (views,) = (layer for layer in LAYERS if layer.name == "views")
    ranges = [each.attrib["render"] for each in parsed(views, n_queries).iter("range")]
    assert ranges[0] == "true"
    assert set(ranges[1:]) == {drawn}


def test_every_layer_has_one_default_style() -> None:
    styles = style_table(LAYERS, 1).to_pylist()
    assert [style["f_table_name"] for style in styles] == [layer.name for layer in LAYERS]
    assert all(style["useAsDefault"] for style in styles)
    assert {style["f_geometry_column"] for style in styles} == {"geom"}
