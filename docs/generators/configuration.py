"""docs/reference/configuration.md: every choice of conf/ with its values and what they are."""

from pathlib import Path

from . import MADE

CONF = Path(__file__).resolve().parents[2] / "conf"
HEAD = f"""# Configuration

{MADE.format(source="`conf/`")}

A configuration consists of one choice per group, as in `gp=raw`, and of single values, as in `gp.n_train=500`.
`gpsim STAGE --show-config` prints the result. Your own folder with the same groups takes precedence:
`gpsim fit-gp --config-dir my_configs gp=mine` reads `my_configs/gp/mine.yaml`. The thresholds of the diagnosis have
[a page of their own](settings.md), and mappings are explained in [import a log](../how-to/import.md#the-mapping)."""
WHAT = {
    "experiment": "A complete experiment: simulator, target, task and training.",
    "budget": "How much to compute.",
    "simulator": "The base simulator.",
    "target": "The machine that is recorded.",
    "task": "The task of a policy, its start states, and the end of an episode.",
    "policy": "How a policy is trained.",
    "gp": "The inputs of the Gaussian processes, and their fit.",
    "launcher": "Where independent jobs run ([run on a cluster](../how-to/cluster.md)).",
    "plan": "Limits and choice of the next commands ([plan](../how-to/plan.md)).",
    "watch": "Detection of changes ([watch](../how-to/watch.md)).",
    "mapping": "The assignment of log fields to channels.",
}


def configuration_page() -> str:
    """The defaults, then a part a group, the default choice first."""
    parts = [HEAD, "## config.yaml", _shown(CONF / "config.yaml")]
    for group, what in WHAT.items():
        parts += [f"## {group}", what]
        for path in sorted((CONF / group).rglob("*.yaml")):
            name = path.relative_to(CONF / group).with_suffix("").as_posix()
            parts += [f"### {group}={name}", _shown(path)]
    return "\n\n".join(parts) + "\n"


def _shown(path: Path) -> str:
    lines = path.read_text(encoding="utf-8").rstrip().splitlines()
    kept = "\n".join(line for line in lines if not line.startswith("# @package"))
    return f"```yaml\n{kept}\n```"
