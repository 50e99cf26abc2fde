"""Which blocks of some modules are reached, by a mark at the beginning of each: no tracing, nearly full speed."""

from __future__ import annotations

import ast
import gc
import importlib
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, Self

MARK = "__reached__"


class _Marks(ast.NodeTransformer):
    """Puts a mark before the first statement of functions, branches, loops and handlers."""

    def __init__(self, first: int) -> None:
        self.following = first

    def generic_visit(self, node: ast.AST) -> ast.AST:
        super().generic_visit(node)
        branches = ast.FunctionDef | ast.AsyncFunctionDef | ast.If | ast.For | ast.While | ast.ExceptHandler
        if isinstance(node, branches | ast.match_case):
            for name in ("body", "orelse"):
                block: list[ast.stmt] = getattr(node, name, [])
                if block:
                    mark = ast.parse(f"{MARK}({self.following})").body[0]
                    self.following += 1
                    for one in ast.walk(mark):
                        ast.copy_location(one, block[0])
                    block.insert(0, mark)
        return node


class Coverage:
    """Within it, modules' functions note in `reached` which of their `blocks` are run."""

    def __init__(self, *modules: str) -> None:
        """Prepare.

        Args:
            modules: Their dotted names.
        """
        self.reached: set[int] = set()
        self.blocks = 0
        """Of all modules."""
        self._codes: dict[tuple[str, str, int], CodeType] = {}
        self._before: list[tuple[FunctionType, CodeType]] = []
        for name in modules:
            module = importlib.import_module(name)
            assert module.__file__ is not None
            marks = _Marks(self.blocks)
            tree = marks.visit(ast.parse(Path(module.__file__).read_text(encoding="utf-8")))
            self.blocks = marks.following
            vars(module)[MARK] = self.reached.add
            for code in _within(compile(tree, module.__file__, "exec", dont_inherit=True)):
                self._codes[code.co_filename, code.co_qualname, code.co_firstlineno] = code

    def __enter__(self) -> Self:
        for one in gc.get_objects():
            if type(one) is FunctionType:
                before = one.__code__
                code = self._codes.get((before.co_filename, before.co_qualname, before.co_firstlineno))
                if code is not None and code.co_freevars == before.co_freevars:
                    self._before.append((one, before))
                    one.__code__ = code
        return self

    def __exit__(self, *_: Any) -> None:
        for function, before in self._before:
            function.__code__ = before
        self._before.clear()


def _within(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _within(constant)
