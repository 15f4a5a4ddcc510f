"""Words on the command line -> one resolved configuration."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

from gpsim.errors import UsageError
from gpsim.recordings import check_bounded
from gpsim.trust import consent

SECTIONS = (
    "simulator", "target", "task", "policy", "gp", "collect",
    "randomise", "residuals", "diagnose", "certify", "evaluate", "deploy", "active", "launcher",
    "plan", "watch",
)  # fmt: skip
"""Settings that hold settings; the rest are values."""
NAMING = (("simulator", "name"), ("target", "model"), ("task", "name"))
"""Settings that may name code to run: they are the user's own words, or of a folder that these name."""


class Settings(dict[str, Any]):
    """A mapping of the configuration; reading what it lacks is a UsageError that names the key."""

    def __init__(self, content: Mapping[str, Any], where: str = "") -> None:
        super().__init__((key, self._nested(value, f"{where}{key}.")) for key, value in content.items())
        self.where = where

    @staticmethod
    def _nested(value: Any, where: str) -> Any:
        return Settings(value, where) if isinstance(value, dict) else value

    def __missing__(self, key: str) -> Any:
        raise UsageError(f"setting '{self.where}{key}' is missing")

    def __reduce__(self) -> tuple[Any, ...]:
        return Settings, (dict(self), self.where)


def resolve(words: Sequence[str], config_dir: Path | None) -> dict[str, Any]:
    """The configuration that the overrides `words` select; `config_dir` holds more choices, found first.

    Raises UsageError for a malformed word, an unknown key or an unknown choice, with the alternatives.
    """
    if config_dir is not None:
        if not config_dir.is_dir():
            raise UsageError(f"--config-dir {config_dir}: no such folder")
        if (config_dir / "config.yaml").exists():
            raise UsageError(
                f"--config-dir {config_dir}: its config.yaml would replace all settings; remove it, put choices into "
                "folders, as gp/mine.yaml, and give other settings as KEY=VALUE"
            )
        for pattern in ("*/*.yaml", "*/*/*.yaml"):
            for choice in config_dir.glob(pattern):
                check_bounded(choice)
    for word in words:
        if word.startswith("=") or ("=" not in word and not word.startswith("~")):
            raise UsageError(f"'{word}' is not a setting: write key=value, as gp.n_train=500")
    _refuse_strangers(words, config_dir)
    compose = _composed if config_dir is None else _composed.__wrapped__  # a folder may change meanwhile
    config = deepcopy(compose(tuple(words), config_dir))
    for name in SECTIONS:
        if not isinstance(config.get(name), dict):
            raise UsageError(f"{name}: expected settings, as {name}.key=value, got {config.get(name)!r}")
    for name in ("experiment", "runs_dir"):
        if not isinstance(config.get(name), str) or not config[name]:
            raise UsageError(f"{name}: expected a text, got {config.get(name)!r}")
    for section, name in NAMING:
        consent(config[section].get(name))
    return Settings(config)


@cache
def _composed(words: tuple[str, ...], config_dir: Path | None) -> dict[str, Any]:
    from .composing import composed  # here: Hydra takes a third of a second to load

    return composed(words, config_dir)


def _refuse_strangers(words: Sequence[str], config_dir: Path | None) -> None:
    """A `+` adds what was not there: at the top, where nothing would read it, it is a slip of the pen."""
    added = [word for word in words if word.startswith("+")]
    if not added:
        return
    known = resolve([word for word in words if word not in added], config_dir)
    for word in added:
        name = re.split(r"[.@/=]", word.lstrip("+"))[0]
        if name not in known:
            raise UsageError(f"'{word}': nothing reads '{name}'; settings: {', '.join(known)}")


def as_yaml(config: Mapping[str, Any]) -> str:
    """The configuration as YAML."""
    from omegaconf import OmegaConf

    return OmegaConf.to_yaml(OmegaConf.create(plain(config)))


def plain(value: Any) -> Any:
    """The configuration without its checks: dictionaries, lists and values."""
    return {key: plain(item) for key, item in value.items()} if isinstance(value, dict) else value
