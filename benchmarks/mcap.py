"""Reading a large MCAP file: ours beside the library's own reader, time and memory."""

import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.reader import make_reader
from mcap.writer import Writer

from benchmarks.table import print_table
from survey.fragments import parse_fragment
from survey.mcap.payload import image_bytes
from survey.mcap.reader import READER
from survey.options import ReadOptions

N_IMAGES = 100
_START_NS = 1_700_000_000_000_000_000


def run(data: Path) -> None:
    """Print seconds and the peak of Python's memory for 100 images of 1 MB among point clouds."""
    del data
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "drive.mcap")
        _write(path)
        images = READER.read(path, ReadOptions(), lambda uri: True).images
        places = [(image.path, parse_fragment(image.fragment).message) for image in images]

        def library() -> None:
            with path.open("rb") as file:
                topics = ("/cam", "/fix")
                for _ in make_reader(file).iter_messages(topics=topics, log_time_order=False):
                    pass

        def one_by_one() -> None:
            for image_path, message in places:
                assert message is not None
                image_bytes(image_path, message)

        rows = [
            ("survey read", *_cost(lambda: READER.read(path, ReadOptions(), lambda uri: True))),
            ("mcap library, the same topics", *_cost(library)),
            (f"{len(places)} images by their places", *_cost(one_by_one)),
        ]
        print(f"{path.stat().st_size / 1e6:.0f} MB\n")
        print_table(("", "seconds", "peak MB"), rows)


def _cost(work: Callable[[], object]) -> tuple[str, str]:
    began = time.perf_counter()
    work()
    seconds = time.perf_counter() - began
    tracemalloc.start()
    work()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return f"{seconds:.2f}", f"{peak / 1e6:.0f}"


def _write(path: Path) -> None:
    rng = np.random.default_rng(0)
    jpeg, cloud = b"\xff\xd8\xff" + rng.bytes(1_000_000), rng.bytes(2_000_000)
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=4 << 20)
        writer.start()
        channels = {
            topic: writer.register_channel(
                topic, "protobuf", writer.register_schema(f"foxglove.{name}", "protobuf", b"")
            )
            for topic, name in (
                ("/cam", "CompressedImage"),
                ("/fix", "LocationFix"),
                ("/points", "PointCloud"),
            )
        }
        for number in range(N_IMAGES):
            at_ns = _START_NS + number * 100_000_000
            stamp = Timestamp(seconds=at_ns // 10**9, nanos=at_ns % 10**9)
            fix = LocationFix(timestamp=stamp, latitude=48.0, longitude=2.0 + number * 1e-6)
            image = CompressedImage(timestamp=stamp, data=jpeg, format="jpeg")
            for topic, content in (
                ("/fix", fix.SerializeToString()),
                ("/cam", image.SerializeToString()),
                ("/points", cloud),
                ("/points", cloud),
            ):
                writer.add_message(channels[topic], at_ns, content, at_ns)
        writer.finish()
