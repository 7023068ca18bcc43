"""mbsim: multibody contact simulation from MotionSolve-style decks.

The public API, in whole: `Model`, `read_model`, `simulate`, `open`, `open_results`,
`MbsimError`; for users' scripts `espy`.
Names are imported at their first use, so that ``import mbsim`` costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mbsim.errors import MbsimError
    from mbsim.plugins.helpers import espy
    from mbsim.reader.builder import Model
    from mbsim.reader.xml import read_model
    from mbsim.results.reading import open_results
    from mbsim.run.simulation import simulate
    from mbsim.run.stepping import open_model as open

__version__ = "0.1.0"

__all__ = [
    "MbsimError",
    "Model",
    "__version__",
    "espy",
    "open",
    "open_results",
    "read_model",
    "simulate",
]

#: Module and name there of every public name.
_HOMES = {
    "MbsimError": ("mbsim.errors", "MbsimError"),
    "Model": ("mbsim.reader.builder", "Model"),
    "espy": ("mbsim.plugins.helpers", "espy"),
    "open": ("mbsim.run.stepping", "open_model"),
    "open_results": ("mbsim.results.reading", "open_results"),
    "read_model": ("mbsim.reader.xml", "read_model"),
    "simulate": ("mbsim.run.simulation", "simulate"),
}


def __getattr__(name: str) -> Any:
    """Import a public name from its home (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'mbsim' has no attribute {name!r}")
    from importlib import import_module

    module, its_name = _HOMES[name]
    value = getattr(import_module(module), its_name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
