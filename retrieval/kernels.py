"""How compiled loops are declared, given their arrays and shared by threads, once for all.

Cached, without the GIL, strict IEEE arithmetic.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import ParamSpec, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

_P = ParamSpec("_P")
_R = TypeVar("_R")
_Item = TypeVar("_Item")
_Scalar = TypeVar("_Scalar", bound=np.generic)


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` on its first call and keep the result in numba's on-disk cache.

    Neither fastmath nor parallel: the same input gives the same bytes on any thread count.
    Division by zero gives inf or nan, as in numpy: a check for it would keep loops from becoming
    vectors. The cast keeps the signature for type checkers, as numba itself has none.
    """
    compiled = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return cast(Callable[_P, _R], compiled)


def in_threads(work: Callable[[_Item], _R], items: Iterable[_Item], n_threads: int) -> Iterator[_R]:
    """Give `work` of each item, in their order; worth it where the work does without the GIL."""
    if n_threads == 1:
        yield from map(work, items)
        return
    with ThreadPoolExecutor(n_threads) as pool:
        yield from pool.map(work, items)


def read_only(array: NDArray[_Scalar], dtype: type[_Scalar]) -> NDArray[_Scalar]:
    """Give a read-only plain view: memory maps and fresh arrays then share one compiled kernel."""
    view = np.ascontiguousarray(array, dtype=dtype).view()
    view.flags.writeable = False
    return view
