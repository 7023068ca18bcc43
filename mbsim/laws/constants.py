"""The numbers that a contact element gives its laws."""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsim.laws.catalog import FrictionLaw, NormalLaw


def normal_constants(law: NormalLaw, contact: Any) -> np.ndarray[Any, Any]:
    """Return what the law's formula takes, from a contact element, shape (n,)."""
    values = [getattr(contact, name) for name in law.parameters]
    return np.array(law.constants(*values), dtype=np.float64)


def friction_parameters(law: FrictionLaw, contact: Any) -> np.ndarray[Any, Any]:
    """Return the law's parameters as the contact element gives them, shape (n,)."""
    own = {each.name: each.default for each in law.own}
    if own:
        own |= dict(contact.friction)
    values = [own[name] if name in own else getattr(contact, name) for name in law.parameters]
    return np.array(values, dtype=np.float64)
