"""Expressions of a model as programs of the stack machine."""

from __future__ import annotations

import numpy as np

from mbsim.system import arrays as a


class ProgramTable:
    """Programs in the order in which they are asked for."""

    def arrays(self) -> a.Programs:
        """Return the tables as they are now."""
        return a.Programs(
            np.zeros(1, dtype=np.int64),
            np.zeros((0, 6), dtype=np.int64),
            np.zeros(0),
            np.zeros((0, 3)),
        )
