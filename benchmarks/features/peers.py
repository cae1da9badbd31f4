"""Our features beside other programs: pyhesaff, OpenCV and mahotas."""

from pathlib import Path

from benchmarks.features import peer_descriptors, peer_detectors, peer_regions


def run(data: Path) -> None:
    """Print every comparison."""
    peer_regions.run(data)
    print()
    peer_descriptors.run(data)
    peer_detectors.run(data)
