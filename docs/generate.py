"""Write what is generated from the code: docs/reference/*.md and conf/diagnose/default.yaml."""

from pathlib import Path

import python_page

from gpsim.diagnosis.settings import Settings, as_page, as_yaml

ROOT = Path(__file__).resolve().parents[1]
PAGES = {"docs/reference/settings.md": as_page, "conf/diagnose/default.yaml": as_yaml}


def main() -> None:
    for name, made in PAGES.items():
        path = ROOT / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(made(Settings()), encoding="utf-8")
    (ROOT / "docs/reference/python.md").write_text(python_page.page(), encoding="utf-8")


if __name__ == "__main__":
    main()
