"""docs/reference/configuration.md: every choice of conf/ with its values and what they are."""

from pathlib import Path

from . import MADE

CONF = Path(__file__).resolve().parents[2] / "conf"
HEAD = f"""# Configuration

{MADE.format(source="`conf/`")}

A configuration is a choice of each group, `gp=raw`, and changes of single values, `gp.n_train=500`. `gpsim STAGE
--show-config` prints the result. A folder of your own with the same groups goes before these:
`gpsim fit-gp --config-dir my_configs gp=mine` takes `my_configs/gp/mine.yaml`. The thresholds of the diagnosis have
[a page of their own](settings.md), and mappings are explained in [import a log](../how-to/import.md#the-mapping)."""
WHAT = {
    "experiment": "What is simulated, driven, asked and trained, as a whole.",
    "budget": "How much of it.",
    "simulator": "What we believe.",
    "target": "What is recorded.",
    "task": "What a policy is to do, where it starts, and when an episode ends.",
    "policy": "How a policy is trained.",
    "gp": "What the Gaussian processes see, and how they are fitted.",
    "launcher": "Where independent jobs run ([run on a cluster](../how-to/cluster.md)).",
    "plan": "What may be played next, and how it is chosen ([plan](../how-to/plan.md)).",
    "watch": "When an account no longer holds ([watch](../how-to/watch.md)).",
    "mapping": "Which field of a log is which channel.",
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
