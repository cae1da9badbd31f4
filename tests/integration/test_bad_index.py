"""Damaged indices, hostile messages, a full disk and Ctrl-C: a clear end, never a crash or hang."""

import json
import os
import pickle
import shlex
import shutil
import signal
import subprocess
import time
from contextlib import nullcontext
from pathlib import Path

import kombu
import psutil
import pytest
from flaneur_command import FLANEUR
from typer.testing import CliRunner

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from contracts.errors import BadIndex
from coordinator.cli import main
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from coordinator.querying import locate_photos
from index.opened import OpenedIndex
from survey import ReadOptions

PAIR = SearchConfig(pair=("hesaff",), k=2, descriptors=("sift",), vote="intersection")
CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff",), descriptors=("sift",), max_frames=120),
    codebooks=CodebookConfig(max_words=200),
)
OPTIONS = ("--crs", "EPSG:2154", "--detectors", "hesaff", "--descriptors", "sift")
SAME_OPTIONS = (*OPTIONS, "--max-frames", "120", "--max-words", "200")


@pytest.fixture(scope="module")
def whole(small_survey: Path, tmp_path_factory: pytest.TempPathFactory, engine: Engine) -> Path:
    root = tmp_path_factory.mktemp("whole")
    intake = read_surveys([("", small_survey)], ReadOptions(crs="EPSG:2154"))
    job, plan = make_plan(root, intake, CONFIG, 32)
    run_job(job, plan, intake, nullcontext(engine), Bars(None))
    return root


@pytest.fixture
def damaged(whole: Path, tmp_path: Path) -> Path:
    """A copy to be damaged; its name is new, so that no worker has it open."""
    return Path(shutil.copytree(whole, tmp_path / "index"))


def say(*arguments: str | Path) -> tuple[int, str]:
    """Exit code and what a person reads."""
    answer = CliRunner().invoke(main, [str(each) for each in arguments])
    assert answer.exception is None or isinstance(answer.exception, SystemExit)
    return answer.exit_code, answer.stderr


def overwrite(path: Path, start: int, content: bytes) -> None:
    """Change bytes and not the size."""
    data = bytearray(path.read_bytes())
    data[start : start + len(content)] = content
    assert len(data) == path.stat().st_size
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("file", "content", "says"),
    [
        ("segments/0001/hesaff-sift/packed.npy", b"short", "packed.npy is 5 bytes long, expected"),
        ("codebooks/0001/hesaff-sift.npy", None, "hesaff-sift.npy is missing, expected a file of"),
        ("CURRENT", b"000042\n", "has no generation 42; there are: 1"),
        ("CURRENT", b"../../elsewhere\n", "expected the number of a generation"),
        ("CURRENT", None, "is not finished"),
        ("generations/000001.json", b"{}", "000001.json"),
        ("generations/000001.json", b'{"format_version": 99}', "format version 99"),
    ],
)
def test_damage_that_shows_at_opening_is_refused_before_the_work(
    damaged: Path, small_survey: Path, file: str, content: bytes | None, says: str
) -> None:
    (damaged / file).unlink() if content is None else (damaged / file).write_bytes(content)
    code, said = say("locate", small_survey / "00.jpg", "--index", damaged)
    assert code == 2
    assert says in said
    assert "to do" not in said


@pytest.mark.parametrize("place", ["folder", "file", "nowhere"])
def test_what_is_no_index_is_refused(tmp_path: Path, small_survey: Path, place: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    for verb in ("locate", "evaluate"):
        given = (small_survey / "00.jpg",) if verb == "locate" else ("--truth", tmp_path / "file")
        code, said = say(verb, *given, "--index", tmp_path / place)
        assert code == 2
        assert str(tmp_path / place) in said
        assert "is not a Flaneur index" in said or "Make an index with" in said


DAMAGE = [
    ("codebooks/0001/hesaff-sift.npz", 300, b"\xfe\xfd\xfc", "not the file that was written"),
    ("codebooks/0001/hesaff-sift.json", 0, b"AAAA", "hesaff-sift.json is damaged"),
    ("segments/0001/hesaff-sift/offsets.npy", 160, b"\xff" * 800, "are damaged"),
    ("segments/0001/hesaff-sift/offsets.npy", 160, (b"\xff" * 7 + b"\x7f") * 100, "are damaged"),
    ("segments/0001/hesaff-sift/counts.npy", 128, b"\xff" * 800, "are damaged"),
    ("segments/0001/hesaff-sift/packed.npy", 128, b"\xff" * 400, "are damaged"),
    ("segments/0001/hesaff-sift/packed.npy", 0, b"AAAAAAAA", "cannot be read as an array"),
    ("catalogue/0001.parquet", 4, b"\xff" * 2000, "cannot be read as a catalogue"),
]


@pytest.mark.parametrize(("file", "start", "content", "says"), DAMAGE)
def test_damage_that_a_worker_finds_is_told_and_the_worker_lives(
    damaged: Path,
    whole: Path,
    small_survey: Path,
    engine: Engine,
    file: str,
    start: int,
    content: bytes,
    says: str,
) -> None:
    overwrite(damaged / file, start, content)
    photo = [str(small_survey / "00.jpg")]
    with pytest.raises(BadIndex) as error:
        next(locate_photos(OpenedIndex(damaged), photo, PAIR, engine.follower, lambda: None))
    assert says in str(error.value)
    again = next(locate_photos(OpenedIndex(whole), photo, PAIR, engine.follower, lambda: None))
    assert again.error is None


def test_damage_that_a_worker_finds_is_wrong_input_too(
    damaged: Path, small_survey: Path, engine: Engine
) -> None:
    file, start, content, says = DAMAGE[0]
    overwrite(damaged / file, start, content)
    photo, broker = small_survey / "00.jpg", engine.app.conf.broker_url
    vote = ("--vote", "intersection")
    code, said = say("locate", photo, "--index", damaged, "--broker", broker, *vote)
    assert says in said
    assert code == 2


@pytest.mark.parametrize(
    ("change", "says"),
    [({"segment": "../../elsewhere"}, "is damaged"), ({"n_shards": "many"}, "is damaged")],
)
def test_an_edited_plan_is_refused(
    damaged: Path, small_survey: Path, change: dict[str, object], says: str
) -> None:
    plan = next(damaged.glob("jobs/*/plan.json"))
    plan.write_text(json.dumps({**json.loads(plan.read_bytes()), **change}))
    code, said = say("index", small_survey, damaged, *SAME_OPTIONS)
    assert code == 2
    assert says in said


class Trap:
    """Unpickled, it makes a file."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return os.mkdir, (str(self.file),)


def test_nothing_in_a_message_is_unpickled(
    whole: Path, small_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    control = tmp_path / "control"
    pickle.loads(pickle.dumps(Trap(control)))  # noqa: S301 - the trap works
    assert control.is_dir()
    sprung = tmp_path / "sprung"
    message = pickle.dumps(([Trap(sprung)], {}, {}))
    headers = {"task": "flaneur.locate", "id": "hostile", "lang": "py", "argsrepr": "()"}
    queue = engine.app.amqp.queues["locate"]
    with engine.app.connection() as connection:
        for kind in ("application/x-python-serialize", "application/json"):
            kombu.Producer(connection.channel()).publish(
                message,
                routing_key="locate",
                exchange=queue.exchange,
                declare=[queue],  # else the message would reach nobody
                content_type=kind,
                content_encoding="binary",
                headers=headers,
            )
    photo = [str(small_survey / "00.jpg")] * 4  # more than there are processes
    answers = locate_photos(OpenedIndex(whole), photo, PAIR, engine.follower, lambda: None)
    assert [answer.error for answer in answers] == [None] * 4
    assert not sprung.exists()


def test_ctrl_c_during_locate_ends_it_and_its_processes(
    whole: Path, small_survey: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.geojson"
    photos = []
    for number in range(200):
        photos.append(tmp_path / f"{number}.jpg")
        photos[-1].symlink_to(small_survey / f"{number % 10:02d}.jpg")
    command = [*FLANEUR, "locate", *map(str, photos), "--index", str(whole), "--out", str(out)]
    running = subprocess.Popen(
        [*command, "--workers", "1", "--vote", "intersection"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert running.stderr is not None
    assert "200 of 200 to do" in running.stderr.readline()
    processes = psutil.Process(running.pid).children(recursive=True)
    assert processes
    time.sleep(0.5)
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 1
    assert "Stopped" in said
    assert "Traceback" not in said
    assert not out.exists()
    _, alive = psutil.wait_procs(processes, timeout=20)
    assert not alive


FULL_DISK = """
set -e
mount --bind "$SURVEY" "$SURVEY"
mount -o remount,ro,bind "$SURVEY"
mount -t tmpfs -o size=100k tmpfs "$DISK"
{flaneur} && exit 90
mount -o remount,size=100m "$DISK"
exec {flaneur}
"""


def test_a_full_disk_is_told_and_the_job_goes_on_once_there_is_room(
    small_survey: Path, tmp_path: Path
) -> None:
    """In mounts of its own: the survey read-only, the index on a disk that fills up."""
    if subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode:
        pytest.skip("this user may not make mounts of its own (unshare -m)")
    index = [*FLANEUR, "index", str(small_survey), f"{tmp_path}/index", *SAME_OPTIONS]
    flaneur = shlex.join([*index, "--workers", "1"])
    answer = subprocess.run(
        ["unshare", "-m", "bash", "-c", FULL_DISK.replace("{flaneur}", flaneur)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={**os.environ, "SURVEY": str(small_survey), "DISK": str(tmp_path)},
    )
    assert "No space left on device" in answer.stderr
    assert answer.stderr.count("generation 1, 10 images") == 1, answer.stderr
    assert answer.returncode == 0
    assert "Traceback" not in answer.stderr
