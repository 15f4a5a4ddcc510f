"""Shell completion: what may follow, from files and registries alone; neither torch nor Hydra is loaded.

Typer calls these with what is typed of a word. Bash cuts words at `=`: there the key stands among the words before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import typer

LOGS = (".bag", ".db3", ".mcap", ".mat", ".csv", ".parquet")
LISTS = tuple(f"diagnose.families.{name}" for name in ("only", "without", "require", "also"))
"""Settings whose values are lists of families."""
RECORDED = ("recording", "collect.source", "deployed")
OF_A_LOG = ("rate=", "dt=", "gap_limit=", "files=")
WHOLE = "@package _global_"  # in a file of settings that are not below its group's name
CONF = files("gpsim.conf")


def words(ctx: typer.Context, incomplete: str) -> list[str]:
    """`key=value` words of a command: groups with their choices, keys, experiments, families, recordings."""
    found = _behind_equals(ctx, incomplete)
    return found if found is not None else _begin([f"{name}=" for name in (*groups(), *keys())], incomplete)


def diagnose_words(ctx: typer.Context, incomplete: str) -> list[str]:
    """A recording or a raw log first, then the settings that count beside one, or what is what in the log."""
    if (found := _behind_equals(ctx, incomplete)) is not None:
        return found
    top = ("seed", "experiment", "runs_dir")
    named = [f"{key}=" for key in (*top, *keys()) if key in top or key.startswith("diagnose.")]
    return [*recordings(incomplete), *_begin([*named, *OF_A_LOG, *_channels(ctx)], incomplete)]


def import_words(ctx: typer.Context, incomplete: str) -> list[str]:
    """Logs first, then changes of the mapping."""
    return [*_below(incomplete, LOGS), *_begin([*OF_A_LOG, *_channels(ctx)], incomplete)]


def _behind_equals(ctx: typer.Context, incomplete: str) -> list[str] | None:
    """The values of the key that is typed; None where none is yet."""
    key, equals, value = incomplete.partition("=")
    typed = [str(word) for name in ("words", "sources") for word in ctx.params.get(name) or ()]
    if not incomplete and typed and "=" not in typed[-1]:  # Click takes a `=` by itself for nothing
        return values_of(typed[-1], "") or None
    if len(typed) > 1 and typed[-1] == "=":
        return values_of(typed[-2], incomplete)
    return [f"{key}={found}" for found in values_of(key, value)] if equals else None


def _channels(ctx: typer.Context) -> list[str]:
    """Of the simulator that is named before: `theta=`."""
    from gpsim.simulators import SIMULATORS  # it loads NumPy, which `--help` does not wait for

    kind = SIMULATORS.get(str(ctx.params.get("simulator")))
    return [] if kind is None else [f"{name}=" for name in (*kind().state.names, *kind().action.names)]


def values_of(key: str, value: str) -> list[str]:
    """What may stand behind `key=`, as far as it is typed."""
    key = key.lstrip("+~")
    if key in LISTS:
        before, bracket, last = value.rpartition("," if "," in value else "[")
        return [f"{before}{bracket or '['}{name}" for name in _begin(families(), last.strip())]
    if key == "diagnosis":
        return artifacts(("diagnose",), value)
    if key in RECORDED:
        return recordings(value)
    named = {"simulator.name": simulators, "collect.mapping": mappings}
    return _begin(named[key]() if key in named else groups().get(key, []), value)


def groups() -> dict[str, list[str]]:
    """Every group of the configuration with its choices: `gp` -> jump, raw ..."""
    found = {}
    for folder in sorted((f for f in CONF.iterdir() if f.is_dir()), key=lambda f: f.name):
        choices = sorted(f.name.removesuffix(".yaml") for f in folder.iterdir() if f.name.endswith(".yaml"))
        if choices and folder.name != "mapping":
            found[folder.name] = choices
    return found


def families() -> list[str]:
    """The families of effects."""
    from gpsim.effects import FAMILIES  # it loads NumPy, which `--help` does not wait for

    return sorted(FAMILIES)


def simulators() -> list[str]:
    """The registered simulators."""
    from gpsim.simulators import SIMULATORS

    return list(SIMULATORS)


def mappings() -> list[str]:
    """The mappings that come with gpsim."""
    return sorted(f.name.removesuffix(".yaml") for f in CONF.joinpath("mapping").iterdir())


def artifacts(stages: Sequence[str], incomplete: str) -> list[str]:
    """Finished artifacts of these stages below runs/, the latest first."""
    found = (path.parent for stage in stages for path in Path("runs").glob(f"*/{stage}/v*/manifest.json"))
    return _begin([str(path) for path in sorted(found, reverse=True)], incomplete)


def recordings(incomplete: str) -> list[str]:
    """Recordings below runs/, and folders and logs at the place that is typed."""
    return list(dict.fromkeys([*artifacts(("collect", "import"), incomplete), *_below(incomplete, LOGS)]))


Completer = Callable[[str], list[str]]


def either(named: Callable[[], Iterable[str]], endings: Sequence[str] | None = None) -> Completer:
    """A name of a list or, with endings, also a file of one's own."""
    return lambda incomplete: [
        *_begin(named(), incomplete),
        *([] if endings is None else _below(incomplete, endings)),
    ]


def finished(*stages: str) -> Completer:
    """An artifact of these stages below runs/, or a folder."""
    return lambda incomplete: [*artifacts(stages, incomplete), *_below(incomplete, ())]


simulator_names, mapping_names = either(simulators, (".py",)), either(mappings, (".yaml", ".yml"))
diagnoses, policies = finished("diagnose"), finished("train-source", "train-gp-policy")
formats = either(lambda: ("mcap", "csv", "parquet"))
strata = either(lambda: ("single", "pair", "triple", "none", "unknown"))


def keys() -> list[str]:
    """Dotted keys of the configuration, of every choice of its groups."""
    import yaml  # it takes a moment that `--help` has no use for

    found: dict[str, None] = {}
    choices = [(f"{group}/{choice}.yaml", f"{group}.") for group, own in groups().items() for choice in own]
    for name, prefix in [("config.yaml", ""), *choices]:
        text = CONF.joinpath(name).read_text(encoding="utf-8")
        content = yaml.safe_load(text) or {}
        content.pop("defaults", None)
        found |= dict.fromkeys(_dotted(content, "" if WHOLE in text.partition("\n")[0] else prefix))
    return list(found)


def _dotted(content: dict[str, Any], prefix: str) -> Iterable[str]:
    for key, value in content.items():
        if isinstance(value, dict) and value:
            yield from _dotted(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}"


def _begin(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in dict.fromkeys(names) if name.startswith(incomplete)]


def _below(incomplete: str, endings: Sequence[str]) -> list[str]:
    """Folders, with a slash, and files of these endings that begin as typed."""
    folder, slash, start = incomplete.rpartition("/")
    try:
        found = sorted(p for p in Path(folder + slash or ".").iterdir() if p.name.startswith(start))
    except OSError:
        return []
    kept = [p for p in found if start.startswith(".") or not p.name.startswith(".")]
    folders = [f"{folder}{slash}{p.name}/" for p in kept if p.is_dir()]
    return folders + [f"{folder}{slash}{p.name}" for p in kept if p.is_file() and p.suffix.lower() in endings]
