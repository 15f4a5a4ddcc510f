"""What mkdocs asks of us: which page comes where, and links that lead out of docs/.

Pages may link to files of the checkout that are no pages, as data/README.md; on the site such a link is plain text.
"""

import posixpath
import re
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
FOLDERS = {"tutorial": "Tutorial", "how-to": "How to", "reference": "Reference", "method": "Method"}
FIRST = (  # in this order; what is not named comes behind, by its title
    "tutorial/first_diagnosis.md",
    "tutorial/python.md",
    "tutorial/mujoco.md",
    "tutorial/drone.md",
    "tutorial/cartpole.md",
    "tutorial/limo.md",
    "how-to/import.md",
    "how-to/simulator.md",
    "how-to/trust.md",
    "how-to/partial_recordings.md",
    "how-to/several_recordings.md",
    "how-to/report.md",
    "how-to/effect.md",
    "how-to/export.md",
    "how-to/export_diagnosis.md",
    "how-to/prove.md",
    "how-to/cluster.md",
    "reference/glossary.md",
    "reference/cli.md",
    "reference/configuration.md",
    "reference/settings.md",
    "reference/effects.md",
    "reference/files.md",
    "reference/python.md",
    "reference/json.md",
    "method/diagnosis.md",
    "method/limits.md",
    "method/notation.md",
    "method/gp.md",
    "method/speed.md",
    "method/blind_test.md",
    "method/proofs.md",
    "method/scored_logs.md",
    "method/peers.md",
    "method/after_the_loop.md",
    "method/scale.md",
)
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")


def title_of(page: Path) -> str:
    """Its first heading."""
    found = re.search(r"^# (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return found.group(1) if found else page.stem


def pages_of(folder: str) -> list[str]:
    """The pages of a folder in their order, as paths below docs/."""
    found = [path.relative_to(DOCS).as_posix() for path in (DOCS / folder).glob("*.md")]
    named = [name for name in FIRST if name in found]
    return named + sorted(set(found) - set(named), key=lambda name: title_of(DOCS / name).lower())


def navigation() -> list[dict[str, Any]]:
    """The site's table of contents."""
    folders: list[dict[str, Any]] = [{title: pages_of(name)} for name, title in FOLDERS.items()]
    return [{"gpsim": "index.md"}, *folders, {"Results": "results.md"}, {"Gallery": "gallery.md"}]


def on_config(config: Any) -> Any:
    """Mkdocs' own name for this moment."""
    config.nav = navigation()
    return config


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Links out of docs/ become plain text."""
    folder = posixpath.dirname(page.file.src_uri)

    def kept(found: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(folder, found.group(3)))
        outside = "://" not in found.group(3) and (target.startswith("..") or target.endswith(".py"))
        return found.group(2) if outside else found.group(0)

    return LINK.sub(kept, markdown)
