"""Array types for the fields of NamedTuple groups: the dimension is part of the name.

The groups (`arrays/scene.py`) annotate their fields with these; `core.address`
reads the annotation to rebuild a group in compiled code. All are C-contiguous.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import numpy.typing as npt

F1 = Annotated[npt.NDArray[np.float64], "float64", 1]
F2 = Annotated[npt.NDArray[np.float64], "float64", 2]
F3 = Annotated[npt.NDArray[np.float64], "float64", 3]
F4 = Annotated[npt.NDArray[np.float64], "float64", 4]
I1 = Annotated[npt.NDArray[np.int64], "int64", 1]
I2 = Annotated[npt.NDArray[np.int64], "int64", 2]
C1 = Annotated[npt.NDArray[np.complex128], "complex128", 1]
C2 = Annotated[npt.NDArray[np.complex128], "complex128", 2]
C3 = Annotated[npt.NDArray[np.complex128], "complex128", 3]
