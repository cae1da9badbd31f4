"""How compiled loops are declared, once: cached, without the GIL, strict IEEE arithmetic."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

_P = ParamSpec("_P")
_R = TypeVar("_R")


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile `function` on its first call and keep the result in numba's on-disk cache.

    Neither fastmath nor parallel: the same input gives the same bytes on any thread count.
    Division by zero gives inf or nan, as in numpy: a check for it would keep loops from becoming
    vectors. The cast keeps the signature for type checkers, as numba itself has none.
    """
    compiled = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return cast(Callable[_P, _R], compiled)
