"""Machine code for roots only: what they call is linked into them once, and optimised there.

Numba optimises and emits every function that another one calls, and links all of it again into
the caller, so that a chain of n functions is optimised n times over. Here a function that only
compiled code calls keeps the code as it was lowered. A root (what Python, or an address, calls)
links all that it reaches, once, is optimised and emitted. That code is its own then: nobody else
calls it, so that LLVM takes away arguments that are not read, and puts a function in its one
caller's place. An array is passed on as five words and two for each of its axes.

Numba's own linking is used where its version is not one of those that this was tested with.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import llvmlite.binding as llvm
from numba.core import codegen, environment
from numba.core.registry import cpu_target

from mbsim.core.code_cache import POLICY

_ENVIRONMENT = "_ZN08NumbaEnv"
_RECURSIVE = codegen.RuntimeLinker.PREFIX

#: Names of the roots that were optimised and emitted in this process.
emitted: list[str] = []


class RootLibrary(codegen.JITCodeLibrary):
    """A function's code as it was lowered, until somebody asks for its address."""

    _as_lowered: Any = None
    _from_cache = False
    _bitcode = b""

    def add_linking_library(self, library: Any) -> None:
        """Remember what this function calls, without optimising or emitting it."""
        self._linking_libraries.append(library)

    def add_ir_module(self, ir_module: Any) -> None:
        """Take what was lowered, without what nobody uses of it."""
        from mbsim.core import plain_code

        plain_code.leave_out_unused(ir_module)
        super().add_ir_module(ir_module)  # type: ignore[no-untyped-call]

    def lowered(self) -> Any:
        """Return the code as it was lowered, its symbols such that many roots may hold them."""
        if self._as_lowered is None:
            module = self._final_module if self._finalized else self._final_module.clone()
            for function in module.functions:
                if not function.is_declaration and function.linkage == llvm.Linkage.external:
                    function.linkage = "linkonce_odr"
            self._as_lowered = module
        return self._as_lowered

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of `name`; 0, and nothing is emitted, where it is not defined."""
        if not self._finalized and not _defines(self._final_module, name):
            return 0
        return int(super().get_pointer_to_function(name))  # type: ignore[no-untyped-call]

    def finalize(self) -> None:
        """Link all that is reached, optimise and emit it."""
        emitted.append(self.name)
        self.lowered()  # before optimised: another root may call this one
        own = set(_defined(self._final_module))
        reached = list(_callers_first(self))[1:]
        self._reload_init.update(*(library._reload_init for library in reached))
        for library in reached:
            raw = isinstance(library, RootLibrary) and not library._from_cache
            module = library.lowered() if raw else library._get_module_for_linking()
            self._final_module.link_in(module, preserve=True)
        self._resolve_recursion()
        for function in self._final_module.functions:
            if not function.is_declaration and function.name not in own:
                function.linkage = llvm.Linkage.internal
        self._optimize_final_module()  # type: ignore[no-untyped-call]
        self._leave_out_errors()
        self._final_module.verify()
        self._finalize_final_module()  # type: ignore[no-untyped-call]
        codegen: Any = self._codegen
        for variable in self._final_module.global_variables:
            if variable.name.startswith(_ENVIRONMENT):
                found = environment.lookup_environment(variable.name)
                if found is not None:
                    codegen.set_env(variable.name, found)

    def _leave_out_errors(self) -> None:
        """Leave out what handles errors of functions that were found to raise none.

        That follows from their code as it is once optimised; their callers were optimised before.
        """
        codegen: Any = self._codegen
        passes = llvm.create_new_module_pass_manager()
        passes.add_ipsccp_pass()
        passes.add_simplify_cfg_pass()
        passes.add_global_dead_code_eliminate_pass()
        passes.run(self._final_module, codegen._pass_builder())

    def _resolve_recursion(self) -> None:
        """Let calls of functions that call each other go straight, now that all are here."""
        names = [v.name for v in self._final_module.global_variables]
        lines = []
        for name in names:
            if name.startswith(_RECURSIVE):
                called = name[len(_RECURSIVE) :]
                if _defines(self._final_module, called):
                    lines.append(f'declare void @"{called}"()')
                    lines.append(f'@"{name}" = linkonce_odr constant ptr @"{called}"')
        if lines:
            self._final_module.link_in(llvm.parse_assembly("\n".join(lines)))

    def serialize_using_object_code(self) -> Any:
        """Return what is stored: machine code, what it defines, and bitcode for linking."""
        name, kind, (code, bitcode) = super().serialize_using_object_code()  # type: ignore[no-untyped-call]
        return name, kind, (code, bitcode, tuple(_defined(self._get_module_for_linking())))

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        """Return the library that the cache holds: optimised, nothing to link.

        Its bitcode is not parsed: that takes ten times as long as to load the machine code, and
        only a root that calls another one would want it.
        """
        name, _, (code, bitcode, defined) = state
        library = codegen.create_library(name)
        library._from_cache, library._bitcode = True, bitcode
        library.enable_object_caching()
        library._set_compiled_object(code)
        library._finalize_final_module()
        codegen._engine._defined_symbols.update(defined)
        return library

    def _get_module_for_linking(self) -> Any:
        """Return the code that another root links in."""
        if self._from_cache and self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self._bitcode)
        return super()._get_module_for_linking()  # type: ignore[no-untyped-call]


def _defined(module: Any) -> Iterator[str]:
    """Yield the names that a module defines."""
    for of in (module.functions, module.global_variables):
        yield from (value.name for value in of if not value.is_declaration)


def _defines(module: Any, name: str) -> bool:
    """Return whether a module has the code of a function."""
    try:
        return not module.get_function(name).is_declaration
    except NameError:
        return False


def _callers_first(root: Any) -> Iterator[Any]:
    """Yield all libraries that `root` reaches, each after all that call it.

    The linker drops what nothing calls yet.
    """
    order: list[Any] = []
    seen = {id(root)}
    stack = [(root, iter(root._linking_libraries))]
    while stack:
        library, called = stack[-1]
        for other in called:
            if id(other) not in seen:
                seen.add(id(other))
                raw = isinstance(other, RootLibrary) and not other._from_cache
                stack.append((other, iter(other._linking_libraries if raw else ())))
                break
        else:
            order.append(library)
            stack.pop()
    yield from reversed(order)


def install() -> None:
    """Make Numba compile and link in this way for the rest of the process, if it was tested."""
    if POLICY == "all":
        return
    install_library()
    from mbsim.core import numba_costs, plain_code, plain_math

    numba_costs.install()
    plain_code.install()
    plain_math.install()


def install_library() -> None:
    """Let code that is stored be loaded as it was linked; compiling asks for `install`."""
    if POLICY == "all":
        return
    generator = cpu_target.target_context.codegen()
    if generator._library_class is RootLibrary:
        return
    set_env = generator.set_env

    def set_where_emitted(name: str, value: Any) -> None:
        if generator._engine.is_symbol_defined(name):
            set_env(name, value)

    generator._library_class = RootLibrary
    generator.set_env = set_where_emitted
