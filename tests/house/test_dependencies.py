"""What is installed beside us."""

from importlib.metadata import distributions


def test_only_one_opencv_is_installed() -> None:
    found = {
        name
        for each in distributions()
        if (name := (each.metadata["Name"] or "").lower()).startswith("opencv")
    }
    assert found == {"opencv-contrib-python-headless"}
