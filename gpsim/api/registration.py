"""The names under which `gymnasium.make` finds gpsim's environments.

`import gpsim` must not wait for Gymnasium, and most who import it need none; but `gymnasium.make("gpsim/CartPole-v0")`
has to find them whichever of the two was imported first. So the names are registered at once where Gymnasium is there,
else as the last act of its import. (Entry points for plugins are gone since Gymnasium 1.0.)
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType

LIBRARY = "gymnasium"
ENVIRONMENTS = {
    "gpsim/CartPole-v0": "gpsim.api.environment:cartpole_env",
    "gpsim/Limo-v0": "gpsim.api.environment:limo_env",
    "gpsim/Corrected-v0": "gpsim.api.environment:corrected_env",
}
"""Id -> what makes it."""


def register_environments() -> None:
    """Now, or when Gymnasium is imported; a second time changes nothing."""
    if LIBRARY in sys.modules:
        _register()
    elif not any(isinstance(finder, _OnImport) for finder in sys.meta_path):
        sys.meta_path.insert(0, _OnImport())


def _register() -> None:
    registration = sys.modules.get("gymnasium.envs.registration")
    for name, entry in ENVIRONMENTS.items():
        if registration is not None and name not in registration.registry:
            registration.register(id=name, entry_point=entry)


class _OnImport:
    """A finder that waits for the one import, then steps aside.

    It is one without importlib.abc's word for it: that takes longer to import than all the rest of `gpsim`.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Gymnasium's own spec, whose loader registers when it is done; None of all other modules."""
        if fullname != LIBRARY:
            return None
        sys.meta_path.remove(self)
        spec = find_spec(fullname)
        loader = spec.loader if spec is not None else None
        if loader is not None:
            execute = loader.exec_module

            def exec_module(module: ModuleType) -> None:
                del loader.exec_module  # from then on the loader is as it was
                execute(module)
                _register()

            loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec
