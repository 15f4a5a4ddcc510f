"""Make docs/gallery.md and its pictures from finished diagnoses: python docs/gallery.py WORK

WORK is the folder in which the commands of docs/gallery.yaml were run. What gpsim said is read from diagnosis.json,
pictures are the diagnoses' own, made smaller. What was known and what was right is written by hand, in the YAML.
"""

import json
import sys
from pathlib import Path

import yaml
from PIL import Image

from gpsim.diagnosis import Diagnosis
from gpsim.reports.account_effects import rows_of
from gpsim.reports.diagnosis_text import noun
from gpsim.reports.quantities import percent

DOCS = Path(__file__).resolve().parent
FIGURE = "held_out_rollout.png"
WIDTH, COLOURS = 640, 48  # of a picture: pixels, and of its palette
HEAD = """# Gallery

Accounts, right and wrong, from files of data/, logs of real machines, and simulated worlds of a blind test. The
figures show the measurement in grey, the base simulator dashed, and the corrected simulator in blue. Both simulators
restart at the measured state about every second, in a held-out part of the recording. If nothing is claimed, there is
no blue line.

`python docs/gallery.py WORK` makes this page from the results of the commands below in the folder WORK. The public
logs are not part of the project ([sources](../data/README.md#public-sets)).
"""


def said(found: Diagnosis) -> str:
    """The verdict, the claims in the account's own sentences, how many small corrections, and how much it explains."""
    headline = [e for e in found.effects if e.role == "headline"]
    joints = {row.whole.partition(" on ")[0]: row.whole for row in rows_of(headline, found) if row.members}
    claims = [*joints.values(), *(e.sentence for e in headline if noun(e.family) not in joints)]
    slight = len(found.effects) - len(headline)
    beside = f"; {slight} small correction{'s' if slight > 1 else ''} in addition" if slight else ""
    share = found.explained.rollout
    explained = "" if share is None else f" Explained: {percent(share.share)} % of the mismatch."
    told = "; ".join(claims) or "no effect is claimed"
    return f"`{found.verdict}`. {told[:1].upper()}{told[1:]}{beside}.{explained}"


def picture(name: str, folder: Path) -> str:
    """The path of a picture, made smaller, from docs/."""
    path = DOCS / "images" / f"gallery_{name}.png"
    with Image.open(folder / "figures" / FIGURE) as image:
        size = (WIDTH, round(image.height * WIDTH / image.width))
        small = image.convert("RGB").resize(size, Image.Resampling.LANCZOS)
        small.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)
    return path.relative_to(DOCS).as_posix()


def section(account: dict[str, str], work: Path) -> str:
    """One account."""
    folder = work / account["folder"]
    path = folder / "diagnosis.json"
    if not path.is_file():
        sys.exit(f"error: {path}: no such diagnosis; in {work} run: {account['command']}")
    found = Diagnosis.from_dict(json.loads(path.read_text(encoding="utf-8")), str(path))
    return f"""## {account["title"]}

    {account["command"]}

![{account["title"]}: measured, base and corrected]({picture(account["name"], folder)})

- **Prior knowledge:** {account["known"]}
- **Account:** {said(found)}
- **Judgement:** {account["right"]}
"""


def main() -> None:
    """Write the page."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    accounts = yaml.safe_load((DOCS / "gallery.yaml").read_text(encoding="utf-8"))
    sections = [section(account, Path(sys.argv[1])) for account in accounts]
    (DOCS / "gallery.md").write_text("\n".join([HEAD, *sections]), encoding="utf-8")


if __name__ == "__main__":
    main()
