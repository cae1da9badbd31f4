"""Models on disk: the adaptive choice, an index's own or the shipped one, and the placing."""

import functools
from importlib import resources
from pathlib import Path

from contracts.errors import BadIndex
from geo.confidence import PlacingModel
from index.files import read_text_file, write_bytes
from retrieval.choice import ChoiceModel

_SHIPPED = "default_choice.json"
_SHIPPED_PLACING = "default_placing.json"


def model_path(root: Path) -> Path:
    """Where `flaneur train` puts an index's own model."""
    return root / "models" / "choice.json"


def read_model(root: Path | None) -> ChoiceModel | None:
    """The index's own model, else (and without an index) the shipped one, else None.

    Raises
    ------
    BadIndex : there is a model and it does not hold.
    """
    if root is not None:
        path = model_path(root)
        try:
            return ChoiceModel.from_json(read_text_file(path).decode())
        except FileNotFoundError:
            pass  # the shipped one
        except (OSError, UnicodeDecodeError) as error:
            raise BadIndex(
                f"{path} cannot be read ({error}). Run `flaneur train` again."
            ) from error
    shipped = resources.files("index") / _SHIPPED
    return ChoiceModel.from_json(shipped.read_text(encoding="utf-8")) if shipped.is_file() else None


def write_model(root: Path, model: ChoiceModel) -> None:
    write_bytes(model_path(root), model.to_json().encode())


@functools.cache
def placing_model() -> PlacingModel:
    """What the certainty of estimates is worked out with: shipped, the same for every index.

    Raises
    ------
    BadIndex : it is damaged.
    """
    shipped = resources.files("index") / _SHIPPED_PLACING
    return PlacingModel.from_json(shipped.read_text(encoding="utf-8"))
