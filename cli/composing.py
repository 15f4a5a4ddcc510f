"""gpsim's settings composed by Hydra from its choices and the user's; every error becomes one line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from textwrap import shorten
from typing import Any

from hydra import compose, initialize_config_module
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import DictConfig, OmegaConf

from gpsim.errors import UsageError, near, nearest

_KEY = re.compile(r"^[+~]{0,2}([\w./@]+)")
_NO_CHOICE = re.compile(
    r"Could not find '([^']+)'.*?Available options in '([^']+)':\s*(.*?)(?:Config search path|\Z)", re.DOTALL
)


class _UsersFolder(SearchPathPlugin):
    """Puts the user's folder before gpsim's own; `hydra.searchpath` would put it behind."""

    folder: Path | None = None

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Hydra calls it while it is initialised."""
        if self.folder is not None:
            search_path.prepend("--config-dir", f"file://{self.folder}")


def composed(words: Sequence[str], config_dir: Path | None) -> dict[str, Any]:
    """The settings that the overrides `words` select; raises UsageError."""
    Plugins.instance().register(_UsersFolder)
    _UsersFolder.folder = config_dir.resolve() if config_dir is not None else None
    try:
        with initialize_config_module("gpsim.conf", version_base="1.3"):
            try:
                config = compose("config", overrides=list(words))
                resolved = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
            except Exception as error:  # Hydra, OmegaConf and the YAML parser raise a dozen kinds
                raise UsageError(_one_line(str(error) or type(error).__name__, words)) from error
    finally:
        _UsersFolder.folder = None
    assert isinstance(resolved, dict)
    return {str(key): value for key, value in resolved.items()}


def _one_line(text: str, words: Sequence[str]) -> str:
    if choices := _NO_CHOICE.search(text):
        name, group, options = choices[1].split("/")[-1], choices[2], choices[3].split()
        meant = near(name, options) or _elsewhere(name, group)
        return f"no '{name}' among the choices of {group}{meant}; there are: {', '.join(options)}"
    if (word := _failing(text, words)) is not None:
        return _unknown_key(word, words)
    said, culprit = " ".join(text.split()), _culprit(words)
    if culprit is not None and ("Unknown function" in said or "no viable alternative" in said):
        return (
            f"{culprit}: Hydra cannot read this value; close a list by ], and quote text in it that holds ( or =, as "
            "\"gp.inputs=[x,'sign(x)']\""
        )
    return said if culprit is None or culprit in said else f"{culprit}: {said}"


def _elsewhere(name: str, group: str) -> str:
    """What was meant, in parentheses, where another group has a choice that is called like it."""
    others = (g for g in files("gpsim.conf").iterdir() if g.is_dir() and g.name != group)
    found = {choice.name: g.name for g in others for choice in g.iterdir()}
    meant = nearest(f"{name}.yaml", found, 0.8)
    return f" (did you mean {found[meant]}={meant.removesuffix('.yaml')}?)" if meant else ""


def _culprit(words: Sequence[str]) -> str | None:
    """The first word that fails by itself: not every error names it."""
    for word in words:
        try:
            compose("config", overrides=[word])
        except Exception:  # as in composed
            return word
    return None


def _failing(text: str, words: Sequence[str]) -> str | None:
    """The word whose key the configuration lacks, if that is what an error says."""
    if "Could not override" not in text:
        return None
    return next((w for w in words if (key := _KEY.match(w)) and f"'{key[1]}'" in text), None)


def _composed_without(word: str, words: Sequence[str]) -> Any:
    """What the other words select; those that fail, too, are left out in their turn."""
    others = [other for other in words if other != word]
    while True:
        try:
            return compose("config", overrides=others)
        except Exception as error:  # as in composed
            failing = _failing(str(error), others)
            others = [other for other in others if other != failing] if failing is not None else []


def _unknown_key(word: str, words: Sequence[str]) -> str:
    """Name the settings beside the one that does not exist, and the nearest."""
    from gpsim.diagnosis.settings import GONE, gone  # it loads NumPy, which `--help` does not wait for

    found = _KEY.match(word)
    assert found is not None
    key, node = found[1], _composed_without(word, words)
    parts = key.split(".")
    for depth, part in enumerate(parts):
        where = ".".join(parts[:depth])
        if not isinstance(node, DictConfig):
            return f"no setting '{key}'; {where} is a value"
        if part not in node:
            known = [str(k) for k in node]
            meant = nearest(part, known)
            if where == "diagnose" and not meant and (old := nearest(part, GONE)):
                return f"no setting '{key}'; {gone(old)}"
            hint = f" (did you mean {'.'.join([*parts[:depth], meant])}?)" if meant else ""
            there = shorten(", ".join(known) or "none", 90 if meant else 900, placeholder=" ...")
            there = f"{where} has: {there}" if where else "--show-config lists all settings"
            return f"no setting '{key}'{hint}; {there}"
        node = node[part]
    return f"'{key}' cannot be set by '{word}'"
