"""Types of arrays, in groups and in signatures of compiled code: the dimension is in the name.

The groups (`arrays/scene.py`) annotate their fields with these; `core.address`
reads the annotation to rebuild a group in compiled code. All are C-contiguous.
"""

from __future__ import annotations

from typing import Annotated, Any

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

# of signatures alone
I3 = Annotated[npt.NDArray[np.int64], "int64", 3]
B1 = Annotated[npt.NDArray[np.bool_], "bool_", 1]
#: Real or complex.
N1 = F1 | C1
N2 = F2 | C2
N3 = F3 | C3
#: Vectors and quaternions of `core.rotation`.
V2 = tuple[float, float]
V3 = tuple[float, float, float]
V4 = tuple[float, float, float, float]
#: Fx, Fy, Mx, My, Tz of friction; spatial vectors.
V5 = tuple[float, float, float, float, float]
V6 = tuple[float, float, float, float, float, float]
#: double *, of which `core.address` makes arrays.
Pointer = Any
