"""Make the pictures of docs/images from real reports: python docs/pictures.py WORK [NAME]...

WORK is a folder in which the reports are made, by the commands below, unless they lie there already; NAME one of the
pictures, all without one. Nothing but data/ and gpsim's own worlds is used. It takes some ten minutes of one core, and
a Chromium (CHROMIUM=/path/to/it, else the one on the path).
"""

import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageChops

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
MOST_BYTES = 200_000
SCREEN = 1280  # pixels, the width of a page
LOOP = "runs/cartpole/report/v0001/report.html"


@dataclass(frozen=True)
class Picture:
    """A picture: the command that makes what it shows, in WORK, the file in which that lies, and how it is taken."""

    command: str
    file: str
    taken: Callable[[Path], Image.Image]


def page(height: int) -> Callable[[Path], Image.Image]:
    """The first screen of a page, so many pixels high."""

    def taken(path: Path) -> Image.Image:
        program = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
        if program is None:
            sys.exit("error: no Chromium; name one: CHROMIUM=/path/to/it")
        with tempfile.TemporaryDirectory() as folder:
            shot = Path(folder) / "shot.png"
            options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
            size = [f"--window-size={SCREEN},{height}", f"--screenshot={shot}"]
            subprocess.run([program, *options, *size, path.as_uri()], check=True, capture_output=True)
            return Image.open(io.BytesIO(shot.read_bytes()))

    return taken


def figure(number: int) -> Callable[[Path], Image.Image]:
    """A figure of a page, counted from 0: pages hold theirs in themselves."""

    def taken(path: Path) -> Image.Image:
        found = re.findall(r'src="(data:image/[^"]+)"', path.read_text(encoding="utf-8"))
        with tempfile.TemporaryDirectory() as folder:
            alone = Path(folder) / "figure.html"
            alone.write_text(f'<body style="margin:0"><img width="{SCREEN}" src="{found[number]}">')
            shot = page(SCREEN)(alone).convert("RGB")
        inside = ImageChops.difference(shot, Image.new("RGB", shot.size, "white")).getbbox()
        return shot.crop((0, 0, SCREEN, inside[3] + 8 if inside else SCREEN))

    return taken


def whole(path: Path) -> Image.Image:
    """A figure that is a file."""
    return Image.open(path)


PICTURES: Mapping[str, Picture] = {
    "diagnosis": Picture(
        f"diagnose {ROOT / 'data' / 'cart.csv'} --simulator cartpole --out found",
        "found/report.html",
        page(592),
    ),
    "loop": Picture("run full-loop experiment=cartpole", LOOP, page(900)),
    "evaluation": Picture("run full-loop experiment=cartpole", LOOP, figure(0)),
    "import": Picture(
        "import runs/limo/collect/v0001/bags/drive.bag --mapping limo_optitrack --out drive",
        "drive/figures/channels.png",
        whole,
    ),
    "prove": Picture("prove --trials 0 --rough 2 --seed 7 --out proof", "proof/report.html", page(900)),
}
BEFORE = {"import": Picture("collect experiment=limo", "runs/limo/collect/v0001/bags/drive.bag", whole)}


def make(name: str, work: Path) -> None:
    """Make the report unless it is there, and its picture."""
    for picture in (*([BEFORE[name]] if name in BEFORE else []), PICTURES[name]):
        if not (work / picture.file).exists():
            subprocess.run([sys.executable, "-m", "gpsim", *picture.command.split()], cwd=work, check=True)
    save(PICTURES[name].taken((work / PICTURES[name].file).resolve()), IMAGES / f"{name}.png")


def save(image: Image.Image, path: Path) -> None:
    """As a small PNG: no wider than a screen, and of a few colours."""
    image = image.convert("RGB")
    if image.width > SCREEN:
        image = image.resize((SCREEN, round(image.height * SCREEN / image.width)), Image.Resampling.LANCZOS)
    few = image.quantize(160, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    path.parent.mkdir(exist_ok=True)
    few.save(path, optimize=True)
    size = path.stat().st_size
    print(f"{path}: {size // 1000} kB")
    if size > MOST_BYTES:
        sys.exit(f"error: {path} is larger than {MOST_BYTES // 1000} kB")


def main() -> None:
    work, *names = sys.argv[1:] or sys.exit(__doc__)
    Path(work).mkdir(parents=True, exist_ok=True)
    for name in names or PICTURES:
        make(name, Path(work))


if __name__ == "__main__":
    main()
