"""Write what is made from the code and from records: pages, benchmarks/proofs.md and conf/diagnose/default.yaml."""

from collections.abc import Callable, Mapping
from pathlib import Path

from generators.cli import cli_page
from generators.configuration import configuration_page
from generators.effects import effects_page
from generators.index import index_page
from generators.proofs import proofs_page, seeds_page
from generators.python_page import page as python_page
from generators.settings import as_page, as_yaml

from gpsim.diagnosis.settings import Settings

ROOT = Path(__file__).resolve().parents[1]
PAGES: Mapping[str, Callable[[], str]] = {
    "docs/reference/settings.md": lambda: as_page(Settings()),
    "docs/reference/cli.md": cli_page,
    "docs/reference/configuration.md": configuration_page,
    "docs/reference/effects.md": effects_page,
    "docs/reference/python.md": python_page,
    "docs/method/proofs.md": seeds_page,
    "benchmarks/proofs.md": proofs_page,
    "docs/index.md": index_page,
    "conf/diagnose/default.yaml": lambda: as_yaml(Settings()),
}


def main() -> None:
    for name, made in PAGES.items():
        path = ROOT / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(made(), encoding="utf-8")


if __name__ == "__main__":
    main()
