"""Words on the command line -> one resolved configuration, by Hydra; every error becomes one line."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_module
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from gpsim.errors import UsageError

_KEY = re.compile(r"^[+~]{0,2}([\w./@]+)")


def resolve(words: Sequence[str], config_dir: Path | None) -> dict[str, Any]:
    """The configuration that the overrides `words` select; `config_dir` holds more choices, found first.

    Raises UsageError for a malformed word, an unknown key or an unknown choice, with the alternatives.
    """
    if config_dir is not None and not config_dir.is_dir():
        raise UsageError(f"--config-dir {config_dir}: no such folder")
    for word in words:
        if "=" not in word and not word.startswith("~"):
            raise UsageError(f"'{word}' is not a setting: write key=value, as gp.n_train=500")
    search = [f"hydra.searchpath=[file://{config_dir.resolve()}]"] if config_dir is not None else []
    with initialize_config_module("gpsim.conf", version_base="1.3"):
        try:
            config = compose("config", overrides=[*search, *words])
            resolved = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
        except (HydraException, OmegaConfBaseException) as error:
            raise UsageError(_one_line(error, words)) from error
    assert isinstance(resolved, dict)
    return {str(key): value for key, value in resolved.items()}


def as_yaml(config: dict[str, Any]) -> str:
    """The configuration as YAML."""
    return OmegaConf.to_yaml(OmegaConf.create(config))


def _one_line(error: Exception, words: Sequence[str]) -> str:
    text = str(error)
    choices = re.search(
        r"Could not find '([^']+)'.*?Available options in '([^']+)':\s*(.*?)(?:Config search path|\Z)",
        text,
        re.DOTALL,
    )
    if choices:
        options = ", ".join(choices.group(3).split())
        return f"no '{choices.group(1).split('/')[-1]}' among the choices of {choices.group(2)}; there are: {options}"
    for word in words:
        key = _KEY.match(word)
        if key and f"'{key.group(1)}'" in text and "Could not override" in text:
            return _unknown_key(key.group(1))
    return " ".join(text.split())


def _unknown_key(key: str) -> str:
    """Name the settings beside the one that does not exist, and the nearest."""
    node: Any = compose("config")
    parts, known = key.split("."), []
    for depth, part in enumerate(parts):
        if not isinstance(node, DictConfig) or part not in node:
            known = [str(k) for k in node] if isinstance(node, DictConfig) else []
            where = ".".join(parts[:depth])
            near = difflib.get_close_matches(part, known, n=1)
            hint = f"; did you mean {'.'.join([*parts[:depth], near[0]])}?" if near else ""
            return f"no setting '{key}'; {where or 'the top level'} has: {', '.join(known)}{hint}"
        node = node[part]
    return f"'{key}' cannot be set; add a new key with +{key}=..."
