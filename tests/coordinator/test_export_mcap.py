"""A survey written as MCAP is the same survey when it is read again, by us and by others."""

import io
from pathlib import Path

import numpy as np
import pyproj
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image
from scipy.spatial.transform import Rotation

from contracts.errors import WrongInput
from contracts.records import Camera, Pose, PosedImage
from coordinator.export.mcap import write_mcap
from survey.decode import decode_image
from survey.fragments import parse_fragment
from survey.mcap.payload import image_bytes
from survey.options import ReadOptions, Survey
from survey.reading import read_survey


def survey_of(images: list[PosedImage], crs: str | None) -> Survey:
    return Survey(tuple(images), (), crs, "table", attribution="© the surveyors", notes=("a",))


def posed(folder: Path, n_images: int, suffix: str = ".jpg", **camera: object) -> list[PosedImage]:
    rng = np.random.default_rng(5)
    found = []
    for number in range(n_images):
        path = folder / f"{number:03d}{suffix}"
        Image.fromarray(rng.integers(0, 256, (24, 32, 3), dtype=np.uint8)).save(path)
        pose = Pose(
            easting=652000.0 + 4 * number,
            northing=6862000.0 + number**2,
            crs="EPSG:2154",
            altitude_m=40.0,
            heading_deg=float(rng.uniform(0, 360)),
            pitch_deg=float(rng.uniform(-60, 60)),
            roll_deg=float(rng.uniform(-170, 170)),
        )
        found.append(
            PosedImage(
                uri=path.name,
                path=str(path),
                pose=pose,
                camera=Camera("front cam", 70.0, 32, 24, **camera),
                captured_at=f"2020-05-01T10:00:{number:02d}.5Z",
            )
        )
    return found


def read(path: Path) -> list[PosedImage]:
    reading = read_survey(path, ReadOptions())
    assert reading.skipped == ()
    assert reading.notes == ()
    return list(reading.images)


def picture(image: PosedImage) -> bytes:
    message = parse_fragment(image.fragment).message
    assert message is not None
    return image_bytes(image.path, message)


def turned(pose: Pose) -> Rotation:
    return Rotation.from_euler("ZYX", [pose.heading_deg, pose.pitch_deg, pose.roll_deg], True)


def test_a_survey_is_the_same_when_it_is_read_again(tmp_path):
    images, told = posed(tmp_path, 12), []
    export = write_mcap(
        survey_of(images, "EPSG:2154"), tmp_path / "out.mcap", lambda: told.append(1)
    )
    assert (export.n_images, export.skipped, len(told)) == (12, (), 12)
    again = read(tmp_path / "out.mcap")
    to_lambert = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:2154", always_xy=True)
    for before, after in zip(images, again, strict=True):
        assert picture(after) == Path(before.path).read_bytes()
        assert before.pose is not None
        assert after.pose is not None
        place = to_lambert.transform(after.pose.easting, after.pose.northing)
        assert np.hypot(place[0] - before.pose.easting, place[1] - before.pose.northing) < 1e-3
        # Meridian convergence of Lambert-93 by its formula: n (lon - 3).
        convergence = 0.7256077650 * (after.pose.easting - 3.0)
        true = turned(before.pose)
        true = Rotation.from_euler("Z", convergence, True) * true
        assert np.degrees((true.inv() * turned(after.pose)).magnitude()) < 0.001
        assert after.pose.north == "true"
        assert after.captured_at == before.captured_at.replace(".5Z", ".500Z")
        assert after.camera == Camera("front_cam", pytest.approx(70.0), 32, 24)
        # Of what height Lambert-93 alone does not say.
        assert after.pose.altitude_m is None


def test_heights_above_the_ellipsoid_are_kept(tmp_path):
    (image,) = posed(tmp_path, 1)
    pose = Pose(2.35, 48.85, "EPSG:4979", altitude_m=81.25, north="true", position_error_m=0.5)
    image = PosedImage(image.uri, image.path, pose=pose)
    write_mcap(survey_of([image], "EPSG:4979"), tmp_path / "out.mcap", lambda: None)
    (again,) = read(tmp_path / "out.mcap")
    assert again.pose is not None
    assert again.pose.altitude_m == pytest.approx(81.25, abs=1e-6)
    assert again.pose.position_error_m == pytest.approx(0.5)
    assert again.pose.heading_deg is None
    # Without a time of its own it gets one that nobody takes for real.
    assert again.captured_at is None


def test_a_heading_alone_stays_alone_and_a_derived_one_is_left_out(tmp_path):
    first, second = posed(tmp_path, 2)
    measured = Pose(2.0, 48.0, "EPSG:4326", heading_deg=211.0, north="true")
    derived = Pose(2.0, 48.0, "EPSG:4326", heading_deg=9.0, north="true", heading_derived=True)
    images = [
        PosedImage(first.uri, first.path, pose=measured, camera=Camera("a")),
        PosedImage(second.uri, second.path, pose=derived, camera=Camera("b")),
    ]
    write_mcap(survey_of(images, "EPSG:4326"), tmp_path / "out.mcap", lambda: None)
    one, two = read(tmp_path / "out.mcap")
    assert one.pose is not None
    assert two.pose is not None
    assert one.pose.heading_deg == pytest.approx(211.0)
    assert (one.pose.pitch_deg, one.pose.roll_deg, two.pose.heading_deg) == (None, None, None)


def test_cameras_of_one_moment_keep_their_own_places(tmp_path):
    images = posed(tmp_path, 6)
    images = [
        PosedImage(
            image.uri, image.path, pose=image.pose, camera=Camera(f"cam {number % 3}"),
            captured_at="2020-05-01T10:00:00Z",
        )
        for number, image in enumerate(images)
    ]  # fmt: skip
    write_mcap(survey_of(images, "EPSG:2154"), tmp_path / "out.mcap", lambda: None)
    again = {picture(image): image for image in read(tmp_path / "out.mcap")}
    assert len(again) == 6
    to_lambert = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:2154", always_xy=True)
    for image in images:
        found = again[Path(image.path).read_bytes()]
        assert image.pose is not None
        assert found.pose is not None
        x, _ = to_lambert.transform(found.pose.easting, found.pose.northing)
        assert x == pytest.approx(image.pose.easting, abs=1e-3)
        assert found.captured_at == "2020-05-01T10:00:00Z"


def test_other_formats_and_turned_images_become_upright_jpegs(tmp_path):
    (tiff,) = posed(tmp_path, 1, ".tif")
    (jpeg,) = posed(tmp_path, 1, ".jpg")
    turned_jpeg = PosedImage("turned.jpg", jpeg.path, pose=jpeg.pose, quarter_turns=1)
    write_mcap(survey_of([tiff, turned_jpeg], "EPSG:2154"), tmp_path / "out.mcap", lambda: None)
    upright = {image.camera.name: image for image in read(tmp_path / "out.mcap")}
    for before, after in ((tiff, upright["front_cam"]), (turned_jpeg, upright["camera"])):
        meant = decode_image(before.path, quarter_turns=before.quarter_turns).rgb
        found = np.asarray(Image.open(io.BytesIO(picture(after))))
        assert found.shape == meant.shape
        assert np.abs(found.astype(int) - meant).mean() < 4


def test_an_mcap_survey_is_exported_from_within_its_file(tmp_path):
    write_mcap(survey_of(posed(tmp_path, 3), "EPSG:2154"), tmp_path / "a.mcap", lambda: None)
    first = read(tmp_path / "a.mcap")
    write_mcap(survey_of(first, "EPSG:4326"), tmp_path / "b.mcap", lambda: None)
    second = read(tmp_path / "b.mcap")
    assert [picture(image) for image in first] == [picture(image) for image in second]
    for one, two in zip(first, second, strict=True):
        assert one.pose is not None
        assert two.pose is not None
        assert two.pose.heading_deg == pytest.approx(one.pose.heading_deg, abs=1e-6)


def test_images_that_cannot_be_read_are_left_out_with_the_reason(tmp_path):
    good, bad = posed(tmp_path, 2)
    Path(bad.path).write_bytes(b"no picture")
    export = write_mcap(survey_of([good, bad], "EPSG:2154"), tmp_path / "out.mcap", lambda: None)
    assert export.n_images == 1
    assert export.skipped[0].uri == bad.uri
    assert len(read(tmp_path / "out.mcap")) == 1


def test_nothing_is_left_beside_what_cannot_be_written(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(WrongInput, match="cannot write"):
        write_mcap(
            survey_of(posed(tmp_path, 1), "EPSG:2154"), tmp_path / "file" / "x.mcap", lambda: None
        )
    out = tmp_path / "out.mcap"
    out.write_bytes(b"old")
    beside = sorted(tmp_path.iterdir())

    def stop() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_mcap(survey_of(posed(tmp_path, 1), "EPSG:2154"), out, stop)
    assert out.read_bytes() == b"old"
    assert sorted(tmp_path.iterdir()) == beside


def test_others_read_it_with_the_schemas_it_carries(tmp_path):
    write_mcap(survey_of(posed(tmp_path, 2), "EPSG:2154"), tmp_path / "out.mcap", lambda: None)
    with (tmp_path / "out.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        said = [
            (channel.topic, schema.name, message.log_time, content.frame_id)
            for schema, channel, message, content in reader.iter_decoded_messages()
            if channel.topic != "/tf"
        ]
        (metadata,) = reader.iter_metadata()
        assert reader.get_summary() is not None
    assert metadata.metadata["attribution"] == "© the surveyors"
    assert [topic for topic, *_ in said] == [
        "/front_cam/location",
        "/front_cam/calibration",
        "/front_cam/image/compressed",
        "/front_cam/location",
        "/front_cam/image/compressed",
    ]
    assert {frame for *_, frame in said} == {"front_cam"}
    assert [time for _, _, time, _ in said] == sorted(time for _, _, time, _ in said)
