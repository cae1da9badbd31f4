"""One segment's catalogue as a Parquet file, of which only what is asked for is read.

Pages carry checksums, so that a changed byte is an error and never another value.
"""

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from contracts.errors import BadIndex

Read = TypeVar("Read")

MEND = "Restore it or index again."


class CatalogueFile:
    """Reads a catalogue of `n_rows` rows with columns as `schema`; nothing before it is asked.

    All methods raise BadIndex, which names the file, if it is missing, damaged or of another
    segment.
    """

    def __init__(self, path: Path, n_rows: int, schema: pa.Schema) -> None:
        self._path = path
        self._n_rows = n_rows
        self._schema = schema

    def column(self, name: str) -> pa.ChunkedArray:
        """One column of all rows."""
        opened = self._opened
        read = self._checked(
            lambda: opened.read(columns=[name], use_threads=False), [name], self._n_rows
        )
        return read.column(name)

    def rows(self, numbers: NDArray[np.int64]) -> list[dict[str, Any]]:
        """Some rows, in the order asked for; only the row groups that hold one are read.

        numbers : (m,) within the file's rows.
        """
        rows: list[dict[str, Any]] = [{}] * len(numbers)
        groups = np.searchsorted(self._first_rows, numbers, side="right") - 1
        for group in np.unique(groups).tolist():
            table = self._group(group)
            first = int(self._first_rows[group])
            for at in np.flatnonzero(groups == group).tolist():
                (rows[at],) = table.slice(int(numbers[at]) - first, 1).to_pylist()
        return rows

    @cached_property
    def _opened(self) -> pq.ParquetFile:
        opened = self._guarded(lambda: pq.ParquetFile(self._path, page_checksum_verification=True))
        if opened.metadata.num_rows != self._n_rows:
            raise BadIndex(
                f"{self._path} has {opened.metadata.num_rows} rows; its segment has "
                f"{self._n_rows} images. {MEND}"
            )
        return opened

    @cached_property
    def _first_rows(self) -> NDArray[np.int64]:
        metadata = self._opened.metadata
        sizes = [metadata.row_group(at).num_rows for at in range(metadata.num_row_groups)]
        if min(sizes, default=0) < 0 or sum(sizes) != self._n_rows:
            raise BadIndex(f"{self._path} has row groups of {sizes[:5]}… rows. {MEND}")
        return np.cumsum([0, *sizes[:-1]], dtype=np.int64)

    def _group(self, number: int) -> pa.Table:
        opened, names = self._opened, self._schema.names
        n_rows = opened.metadata.row_group(number).num_rows
        return self._checked(
            lambda: opened.read_row_group(number, columns=names, use_threads=False), names, n_rows
        )

    def _checked(self, read: Callable[[], pa.Table], names: list[str], n_rows: int) -> pa.Table:
        """What is read, refused unless it is all that was asked for and sound text."""
        schema = pa.schema([self._schema.field(name) for name in names])

        def checked() -> pa.Table:
            # Cast, as pandas may have written a wider kind of text.
            table = read().select(names).cast(schema)
            table.validate(full=True)
            if len(table) != n_rows:
                raise ValueError(f"{len(table)} of {n_rows} rows")
            return table

        return self._guarded(checked)

    def _guarded(self, read: Callable[[], Read]) -> Read:
        try:
            return read()
        except (OSError, ValueError, KeyError, MemoryError, pa.ArrowException) as error:
            raise BadIndex(
                f"{self._path} cannot be read as a catalogue ({error}). {MEND}"
            ) from error
