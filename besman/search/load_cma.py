"""The library ``cma`` without what it loads for its plots and its surrogate models."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

# Shortcuts for an interactive shell, which load matplotlib.pyplot, and models of `fmin_lq_surr`,
# which load scipy.stats: three quarters of the time that `import cma` takes.
_LATER = ("cma.s", "cma.fitness_models")


def load_cma() -> ModuleType:
    """Import ``cma``, so that pyplot and ``scipy.stats`` are loaded only by who looks at them.

    The modules that load these are executed when one of their names is first used; until then
    they are known, and nothing about ``cma`` is different for other code of the same process.

    Returns
    -------
    module
        ``cma``.
    """
    finder = _LaterFinder()
    sys.meta_path.insert(0, finder)
    try:
        import cma
    finally:
        sys.meta_path.remove(finder)
    loaded: ModuleType = cma
    return loaded


class _LaterFinder(MetaPathFinder):
    """Finds the modules that are to be executed later; all others are found as ever."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how to load a module, None if that is not for this finder to say."""
        if fullname not in _LATER:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec
