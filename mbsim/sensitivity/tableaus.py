"""Explicit methods by which derivatives are carried along the motion within a step.

Their last stage is the end of a part. Source: J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6
(1980) 19; P. Bogacki, L. F. Shampine, Appl. Math. Lett. 2 (1989) 321.
"""

from __future__ import annotations

import numpy as np

from mbsim.integrators.dopri5 import (
    A21,
    A31,
    A32,
    A41,
    A42,
    A43,
    A51,
    A52,
    A53,
    A54,
    A61,
    A62,
    A63,
    A64,
    A65,
    B1,
    B3,
    B4,
    B5,
    B6,
    C2,
    C3,
    C4,
    C5,
    D1,
    D3,
    D4,
    D5,
    D6,
    D7,
    E1,
    E3,
    E4,
    E5,
    E6,
    E7,
)  # fmt: skip

#: Rows of what follows: of order 5; of order 3, which does for steps of generalised-alpha.
OF_FIFTH, OF_THIRD = range(2)
#: Weights of the fifth coefficient of the polynomial of a part; a cubic has none.
DENSE = np.zeros((2, 7))
#: Times of stages, weights of the slopes before, weights of the error.
C, A, E = np.zeros((2, 7)), np.zeros((2, 7, 6)), np.zeros((2, 7))
#: The stage at the end, and the order.
LAST, ORDER = np.array((6, 3)), np.array((5.0, 3.0))
C[OF_FIFTH] = 0.0, C2, C3, C4, C5, 1.0, 1.0
A[OF_FIFTH, 1, :1] = A21
A[OF_FIFTH, 2, :2] = A31, A32
A[OF_FIFTH, 3, :3] = A41, A42, A43
A[OF_FIFTH, 4, :4] = A51, A52, A53, A54
A[OF_FIFTH, 5, :5] = A61, A62, A63, A64, A65
A[OF_FIFTH, 6] = B1, 0.0, B3, B4, B5, B6
DENSE[OF_FIFTH] = D1, 0.0, D3, D4, D5, D6, D7
E[OF_FIFTH] = E1, 0.0, E3, E4, E5, E6, E7
C[OF_THIRD, :4] = 0.0, 1 / 2, 3 / 4, 1.0
A[OF_THIRD, 1, :1] = 1 / 2
A[OF_THIRD, 2, :2] = 0.0, 3 / 4
A[OF_THIRD, 3, :3] = 2 / 9, 1 / 3, 4 / 9
E[OF_THIRD, :4] = -5 / 72, 1 / 12, 1 / 9, -1 / 8
