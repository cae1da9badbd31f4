"""Results as a GeoPackage that looks right in QGIS: layers, their rows, their styles, the file."""

from coordinator.export.geopackage.writing import write_geopackage

__all__ = ["write_geopackage"]
