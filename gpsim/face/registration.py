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
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.abc import Loader

LIBRARY = "gymnasium"
ENVIRONMENTS = {
    "gpsim/CartPole-v0": "gpsim.face.environment:cartpole_env",
    "gpsim/Limo-v0": "gpsim.face.environment:limo_env",
    "gpsim/Corrected-v0": "gpsim.face.environment:corrected_env",
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
    """Waits for the one import, then steps aside.

    It is a finder without importlib.abc's word for it: that takes longer to import than all the rest of `gpsim`.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Gymnasium's own spec, whose loader registers when it is done; None of all other modules."""
        if fullname != LIBRARY:
            return None
        sys.meta_path.remove(self)
        spec = find_spec(fullname)
        if spec is not None and spec.loader is not None:
            spec.loader = _Registering(spec.loader)  # type: ignore[assignment]
        return spec


class _Registering:
    """Another loader, and the registration after it."""

    def __init__(self, inner: Loader) -> None:
        self._inner = inner

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)  # what readers of resources ask of the real one

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        """As the real one."""
        return self._inner.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        """Run it, then register; from then on the real loader stands in its own place."""
        if module.__spec__ is not None:
            module.__spec__.loader = self._inner
        module.__loader__ = self._inner
        self._inner.exec_module(module)
        _register()
