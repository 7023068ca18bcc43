"""How the ODE vector of a mechanism begins; methods are told by hooks (`core.problem`)."""

from __future__ import annotations

#: Numbers of a body, body after body: position 3, quaternion 4, velocity 3, angular velocity 3.
BODY_SIZE = 13
#: Where these begin, behind the position.
AT_Q, AT_V, AT_W = 3, 7, 10
