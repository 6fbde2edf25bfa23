"""Types of the native half; its docstrings say what arguments mean."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Literal, Self, SupportsIndex, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

type Floats = NDArray[np.float64]
type Bools = NDArray[np.bool_]

__version__: str
FEATURES: list[tuple[str, str, str]]

def value(states: ArrayLike, game: PursuitGame, *, threads: int | None = None) -> Floats: ...
