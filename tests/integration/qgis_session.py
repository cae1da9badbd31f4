"""Run by QGIS's own Python: opens GeoPackages as a person would, tells and draws what is there.

Its argument is JSON, a list of maps to draw: {"file", "layers", "picture", "extent"}; the layers
are drawn as listed, the first on top, in west, south, east, north, or all there is. What was found
is printed as JSON, a map each.
"""

import json
import sys

from qgis.core import (
    QgsApplication,
    QgsExpression,
    QgsExpressionContext,
    QgsExpressionContextUtils,
    QgsMapRendererSequentialJob,
    QgsMapSettings,
    QgsRectangle,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor


def opened(path: str, name: str) -> tuple[QgsVectorLayer, dict[str, object]]:
    layer = QgsVectorLayer(f"{path}|layername={name}", name, "ogr")
    _, styled = layer.loadDefaultStyle()
    found = {
        "valid": layer.isValid(),
        "styled": styled,
        "crs": layer.crs().authid(),
        "count": layer.featureCount(),
        "renderer": layer.renderer().type(),
        "aliases": [field.displayName() for field in layer.fields()],
        "tip": tip_of_first(layer),
        "labels": layer.labelsEnabled(),
    }
    return layer, found


def tip_of_first(layer: QgsVectorLayer) -> str:
    feature = next(layer.getFeatures(), None)
    context = QgsExpressionContext(QgsExpressionContextUtils.globalProjectLayerScopes(layer))
    if feature is not None:
        context.setFeature(feature)
    return QgsExpression.replaceExpressionText(layer.mapTipTemplate(), context)


def draw(layers: list[QgsVectorLayer], picture: str, extent: list[float]) -> list[str]:
    settings = QgsMapSettings()
    settings.setLayers(layers)
    settings.setDestinationCrs(layers[0].crs())
    settings.setOutputSize(QSize(800, 600))
    settings.setOutputDpi(96)
    settings.setBackgroundColor(QColor("white"))
    if extent:
        settings.setExtent(QgsRectangle(*extent))
    else:
        settings.setExtent(settings.fullExtent())
    context = QgsExpressionContext()
    context.appendScope(QgsExpressionContextUtils.mapSettingsScope(settings))
    settings.setExpressionContext(context)
    job = QgsMapRendererSequentialJob(settings)
    job.start()
    job.waitForFinished()
    job.renderedImage().save(picture)
    return [error.message for error in job.errors()]


application = QgsApplication([], False)
application.initQgis()
maps = []
for wanted in json.loads(sys.argv[1]):
    pairs = [opened(wanted["file"], name) for name in wanted["layers"]]
    errors = draw([layer for layer, _ in pairs], wanted["picture"], wanted["extent"])
    found = {layer.name(): told for layer, told in pairs}
    maps.append({"layers": found, "errors": errors})
print(json.dumps(maps))  # noqa: T201
