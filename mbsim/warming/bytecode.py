"""Bytecode of the package's modules, kept as Python keeps it where it may write."""

from __future__ import annotations

import compileall

from mbsim.core.code_cache import PACKAGE


def keep_bytecode() -> bool:
    """Write the bytecode of modules that have none; return whether all have theirs then.

    Python does so when it imports a module, unless PYTHONDONTWRITEBYTECODE is set or the user may
    not write there; installers may do without. It lies where Python looks for it: in
    ``__pycache__`` beside each module, or below PYTHONPYCACHEPREFIX.
    """
    return bool(compileall.compile_dir(PACKAGE, quiet=2))
