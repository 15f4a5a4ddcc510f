"""Words on the command line -> one resolved configuration, by Hydra; every error becomes one line."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_module
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import DictConfig, OmegaConf

from gpsim.errors import UsageError
from gpsim.recordings import check_bounded
from gpsim.trust import consent

_KEY = re.compile(r"^[+~]{0,2}([\w./@]+)")
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
    if config_dir is not None and not config_dir.is_dir():
        raise UsageError(f"--config-dir {config_dir}: no such folder")
    if config_dir is not None and (config_dir / "config.yaml").exists():
        raise UsageError(
            f"--config-dir {config_dir}: its config.yaml would replace all of gpsim's settings; "
            "keep choices in folders, as gp/mine.yaml, and words for the rest"
        )
    for choice in _choices(config_dir):
        check_bounded(choice)
    for word in words:
        if word.startswith("=") or ("=" not in word and not word.startswith("~")):
            raise UsageError(f"'{word}' is not a setting: write key=value, as gp.n_train=500")
    _refuse_strangers(words, config_dir)
    resolved = _composed(tuple(words), config_dir) if config_dir else deepcopy(_of_the_package(tuple(words)))
    checked = _checked(resolved)
    for section, name in NAMING:
        consent(checked[section].get(name))
    return checked


@cache
def _of_the_package(words: tuple[str, ...]) -> dict[str, Any]:
    """What Hydra makes of gpsim's own choices, a third of a second's work; a user's may change."""
    return _composed(words, None)


def _composed(words: tuple[str, ...], config_dir: Path | None) -> dict[str, Any]:
    with _hydra(config_dir):
        try:
            config = compose("config", overrides=list(words))
            resolved = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
        except Exception as error:  # Hydra, OmegaConf and the YAML parser raise a dozen kinds
            raise UsageError(_one_line(error, words)) from error
    assert isinstance(resolved, dict)
    return {str(key): value for key, value in resolved.items()}


def _choices(config_dir: Path | None) -> Iterator[Path]:
    """The files of a user's choices, as gp/mine.yaml."""
    if config_dir is not None:
        yield from config_dir.glob("*/*.yaml")
        yield from config_dir.glob("*/*/*.yaml")


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


class _UsersFolder(SearchPathPlugin):
    """Puts the user's folder before gpsim's own; `hydra.searchpath` would put it behind."""

    folder: Path | None = None

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Hydra calls it while it is initialised."""
        if self.folder is not None:
            search_path.prepend("--config-dir", f"file://{self.folder}")


@contextmanager
def _hydra(config_dir: Path | None) -> Iterator[None]:
    """Hydra, looking in the user's folder first."""
    Plugins.instance().register(_UsersFolder)
    _UsersFolder.folder = config_dir.resolve() if config_dir is not None else None
    try:
        with initialize_config_module("gpsim.conf", version_base="1.3"):
            yield
    finally:
        _UsersFolder.folder = None


def _checked(config: dict[str, Any]) -> dict[str, Any]:
    """The configuration with every part in its place."""
    for name in SECTIONS:
        if not isinstance(config.get(name), dict):
            raise UsageError(f"{name}: expected settings, as {name}.key=value, got {config.get(name)!r}")
    for name in ("experiment", "runs_dir"):
        value = config.get(name)
        if not isinstance(value, str) or not value:
            raise UsageError(f"{name}: expected a text, got {value!r}")
    return Settings(config)


def as_yaml(config: Mapping[str, Any]) -> str:
    """The configuration as YAML."""
    return OmegaConf.to_yaml(OmegaConf.create(plain(config)))


def plain(value: Any) -> Any:
    """The configuration without its checks: dictionaries, lists and values."""
    return {key: plain(item) for key, item in value.items()} if isinstance(value, dict) else value


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
    word = _failing(error, words)
    if word is not None:
        return _unknown_key(word, words)
    said, culprit = " ".join(text.split()) or type(error).__name__, _culprit(words)
    if culprit is not None and ("Unknown function" in said or "no viable alternative" in said):
        return (
            f"{culprit}: not a value that Hydra reads; a list is closed by ], and text in it that holds ( or = is "
            f"quoted: \"gp.inputs=[x,'sign(x)']\", \"collect.changes=['rate=50']\""
        )
    return said if culprit is None or culprit in said else f"{culprit}: {said}"


def _culprit(words: Sequence[str]) -> str | None:
    """The first word that fails by itself: not every error names it."""
    for word in words:
        try:
            compose("config", overrides=[word])
        except Exception:  # as in resolve
            return word
    return None


def _failing(error: Exception, words: Sequence[str]) -> str | None:
    """The word whose key the configuration lacks, if that is what the error says."""
    text = str(error)
    if "Could not override" not in text:
        return None
    return next((w for w in words if (key := _KEY.match(w)) and f"'{key.group(1)}'" in text), None)


def _composed_without(word: str, words: Sequence[str]) -> Any:
    """What the other words select; those that fail, too, are left out in their turn."""
    others = [other for other in words if other != word]
    while True:
        try:
            return compose("config", overrides=others)
        except Exception as error:  # as in resolve
            failing = _failing(error, others)
            others = [other for other in others if other != failing] if failing is not None else []


def _unknown_key(word: str, words: Sequence[str]) -> str:
    """Name the settings beside the one that does not exist, and the nearest."""
    found = _KEY.match(word)
    assert found is not None
    key, node = found.group(1), _composed_without(word, words)
    parts = key.split(".")
    for depth, part in enumerate(parts):
        where = ".".join(parts[:depth])
        if not isinstance(node, DictConfig):
            return f"no setting '{key}'; {where} is a value"
        if part not in node:
            known = [str(k) for k in node]
            near = difflib.get_close_matches(part, known, n=1)
            hint = f" (did you mean {'.'.join([*parts[:depth], near[0]])}?)" if near else ""
            return f"no setting '{key}'{hint}; {where or 'the top level'} has: {', '.join(known) or 'none'}"
        node = node[part]
    return f"'{key}' cannot be set by '{word}'"
