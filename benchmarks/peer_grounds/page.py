"""The page and the figure of what came out, from the cells that are kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.lines import Line2D

from peer_grounds.contract import Ground, Peer

Cell = dict[str, Any]
COMMAND = "GPSIM_RECORDINGS=... python benchmarks/peers.py && python benchmarks/peers.py --keep"
T95 = {
    2: 12.71,
    3: 4.30,
    4: 3.18,
    5: 2.78,
    6: 2.57,
    7: 2.45,
    8: 2.36,
}  # of Student's t, by the number of seeds
COLOURS = {"gpsim": "#0b6e4f", "parameters": "#c8553d", "black box": "#4a6fa5"}
MOST_NAMES, MOST_PARAMETERS = 6, 12  # of a peer, that are told
COLUMNS = 2  # of the figure


def write_page(root: Path, grounds: Sequence[Ground], cells: Sequence[Cell]) -> list[Path]:
    """docs/method/peers.md and docs/images/peers.svg; where they lie."""
    page, image = root / "docs" / "method" / "peers.md", root / "docs" / "images" / "peers.svg"
    draw(image, grounds, cells)
    page.write_text("\n".join(words(grounds, cells)) + "\n", encoding="utf-8")
    return [page, image]


def words(grounds: Sequence[Ground], cells: Sequence[Cell]) -> list[str]:
    """The lines of the page."""
    lines = [
        "# gpsim and other methods", "",
        "`python benchmarks/peers.py --keep` makes this page from the results in `benchmarks/peers.json`, which were",
        "computed with:",
        "",
        f"    pip install -c constraints.txt -e '.[peers]'\n    {COMMAND}", "",
        "Every method gets the same training part. A small grid is searched on a held-out part of it; the test part is",
        "never used. gpsim only knows the plain simulator. Times are processor seconds of one thread, with imports,",
        "on a shared machine. `benchmarks/peers.json` has every parameter. Its results with a `clock_s` of 0 come",
        "from the same functions, before the command existed.",
        "", "![Error against processor time, one dot per method and task](../images/peers.svg)",
    ]  # fmt: skip
    for ground in grounds:
        lines += section(ground, [c for c in cells if c["ground"] == ground.name])
    return lines


def section(ground: Ground, cells: Sequence[Cell]) -> list[str]:
    """A ground: table, parameters, efforts, what is published."""
    lines = ["", f"## {ground.title}", "", f"{ground.split[0].upper()}{ground.split[1:]}.", ""]
    lines += [*placed(ground, cells), ""]
    lines += [
        f"| peer | {' | '.join(ground.columns)} | names | processor s |",
        "|---" * (len(ground.columns) + 3) + "|",
    ]
    by_peer = {peer.name: [c for c in cells if c["peer"] == peer.name] for peer in ground.peers}
    lines += [row(ground, peer, by_peer[peer.name]) for peer in ground.peers]
    if ground.published:
        lines += ["", "Published, run by others:", ""]
        lines += [f"- {p.value:g} {p.unit}, {p.what} ({p.source})" for p in ground.published]
    sizes = [(peer, c) for peer in ground.peers for c in by_peer[peer.name][:1] if c.get("parameters")]
    if sizes and len(ground.seeds) == 1:
        few = [
            (peer, p) for peer, c in sizes for p in c["parameters"] if len(c["parameters"]) <= MOST_PARAMETERS
        ]
        if few:
            lines += ["", "| peer | parameter | value | 90 % | published |", "|---|---|---|---|---|"]
        lines += [size(peer, p) for peer, p in few]
    if ground.remarks is not None:
        lines += ["", ground.remarks(cells).strip()]
    efforts = [effort(peer, by_peer[peer.name]) for peer in ground.peers]
    folded = '<details markdown="1"><summary>Methods and their effort</summary>'
    return [*lines, "", folded, "", *efforts, "", "</details>"]


def placed(ground: Ground, cells: Sequence[Cell]) -> list[str]:
    """Who is ahead, and where gpsim is, in a sentence."""
    whole = sorted(dots(ground, cells), key=lambda one: one[2], reverse=ground.more_is_better)
    place = next(
        (i for i, (peer, *_) in enumerate(whole) if peer.kind == "gpsim" and peer.name != "gpsim-gp"), None
    )
    if place is None or len(whole) < 2:
        return []
    texts = [f"{peer.title}, {value:.3g} {unit}".strip() for peer, _, value, unit in whole]
    if place == 0:
        behind = next((t for t, one in zip(texts, whole, strict=True) if one[2] != whole[0][2]), "nobody")
        return [f"**Ahead in {ground.headline}: {texts[0]}.** Next: {behind}."]
    return [f"**Ahead in {ground.headline}: {texts[0]}.** Place {place + 1} of {len(whole)}: {texts[place]}."]


def row(ground: Ground, peer: Peer, cells: Sequence[Cell]) -> str:
    """A peer's row."""
    done = [c for c in cells if c["status"] == "done"]
    if not done:
        why = f"{cells[0]['status']}: {plain(cells[0]['why'])}" if cells else "not run yet"
        return f"| {peer.title} | {' | '.join([why, *[''] * (len(ground.columns) - 1)])} | | |"
    values = [pooled([c["scores"].get(name) for c in done]) for name in ground.columns]
    if len(done) < len(ground.seeds):
        values[0] += f" ({len(done)} of {len(ground.seeds)} seeds)"
    names = [plain(n) for n in done[0]["names"]] if len(ground.seeds) == 1 else []
    told = ", ".join(names[:MOST_NAMES]) + (
        f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    )
    return f"| {peer.title} | {' | '.join(values)} | {told or '-'} | {seconds(done):.0f} |"


def pooled(scores: Sequence[dict[str, Any] | None]) -> str:
    """A score of one seed with its interval, or the mean of several with a 95 % interval of Student's t."""
    known = [s for s in scores if s is not None and s["value"] is not None]
    if not known:
        return "ran away" if any(s is not None for s in scores) else "-"
    unit = f" {known[0]['unit']}" if known[0]["unit"] else ""
    values = [s["value"] for s in known]
    away = f"; {len(scores) - len(known)} ran away" if len(known) < len(scores) else ""
    if len(scores) == 1:
        edges = "" if known[0]["low"] is None else f" ({known[0]['low']:.3g} to {known[0]['high']:.3g})"
        return f"{values[0]:.4g}{unit}{edges}"
    mean = sum(values) / len(values)
    if len(values) < 2:
        return f"{mean:.4g}{unit}{away}"
    spread = math.sqrt(sum((v - mean) ** 2 for v in values) / (len(values) - 1) / len(values))
    half = T95.get(len(values), 2.0) * spread
    return f"{mean:.4g}{unit} ({mean - half:.3g} to {mean + half:.3g}){away}"


def seconds(cells: Sequence[Cell]) -> float:
    """Processor seconds a cell."""
    return float(sum(c["processor_s"] for c in cells) / len(cells))


def size(peer: Peer, p: dict[str, Any]) -> str:
    """A parameter's row."""
    edges = "-" if p["low"] is None or p["high"] is None else f"{p['low']:.4g} to {p['high']:.4g}"
    known = "" if p["known"] is None else f"{p['known']:g}"
    return f"| {peer.title} | {plain(p['name'])} | {p['value']:.4g} {p['unit']} | {edges} | {known} |"


def effort(peer: Peer, cells: Sequence[Cell]) -> str:
    """What a peer is, what effort it got, and what crashed."""
    said = [peer.what] if peer.what else []
    if cells and cells[0]["status"] != "done":
        said.append(f"{cells[0]['status']}: {cells[0]['why']}")
    for cell in cells[:1]:
        said += [cell.get("tuned") or "", cell.get("notes") or ""]
    packages = cells[0]["versions"] if cells else {}
    said += [", ".join(f"{k} {v}" for k, v in sorted(packages.items()) if k != "gpsim" and v[0].isdigit())]
    return f"- {peer.title}: {plain('; '.join(s for s in said if s)) or 'not run yet'}."


def plain(text: str) -> str:
    """A text that stays in its cell of a table."""
    return text.replace("|", "/").replace("\n", " ").replace("<", "").replace(">", "")


def draw(path: Path, grounds: Sequence[Ground], cells: Sequence[Cell]) -> None:
    """Score of the headline against processor seconds; a dot a peer and ground, their names beside the panel."""
    shown = [g for g in grounds if dots(g, cells)]
    rows = max(-(-len(shown) // COLUMNS), 1)
    with plt.rc_context(
        {"svg.hashsalt": "peers", "font.size": 8, "axes.spines.right": False, "axes.spines.top": False}
    ):
        size = (4.6 * COLUMNS, 2.4 * rows + 0.3)
        figure, axes = plt.subplots(rows, COLUMNS, figsize=size, squeeze=False, layout="constrained")
        for axis in axes.flat[len(shown) :]:
            axis.axis("off")
        for axis, ground in zip(axes.flat, shown, strict=False):
            panel(axis, ground, dots(ground, cells))
        kinds = [Line2D([], [], marker="o", linestyle="", color=c, label=kind) for kind, c in COLOURS.items()]
        figure.legend(handles=kinds, loc="outside upper left", ncols=len(kinds), frameon=False)
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)


def panel(axis: Any, ground: Ground, found: Sequence[tuple[Peer, float, float, str]]) -> None:
    """The dots of a ground; names to the right in the order of their heights, each with a line to its dot."""
    for peer, spent, value, _ in found:
        axis.plot(spent, value, "o", color=COLOURS[peer.kind])
    unit = f" [{found[0][3]}]" if found[0][3] else ""
    better = "more is better" if ground.more_is_better else "less is better"
    axis.set(xscale="log", xlabel="processor s", ylabel=f"{ground.headline}{unit}\n{better}")
    axis.set_title(ground.title[0].upper() + ground.title[1:], loc="left")
    spends, values = [spent for _, spent, _, _ in found], [value for _, _, value, _ in found]
    edges = [
        (10 ** math.floor(math.log10(min(v) * 0.7)), 10 ** math.ceil(math.log10(max(v) * 1.4)))
        for v in (spends, values)
    ]
    axis.set_xlim(*edges[0])
    if ground.more_is_better:
        axis.margins(y=0.15)
    else:
        axis.set(yscale="log", ylim=edges[1])
    axis.minorticks_off()
    names = sorted(found, key=lambda one: one[2])
    for i, (peer, spent, value, _) in enumerate(names):
        at = (1.04, 0.5 + (i - (len(names) - 1) / 2) * min(0.125, 0.9 / max(len(names) - 1, 1)))
        line = {
            "arrowstyle": "-",
            "color": "#c0c4ca",
            "linewidth": 0.6,
            "shrinkA": 1,
            "shrinkB": 3,
            "relpos": (0, 0.5),
        }
        axis.annotate(
            peer.title.removesuffix(" what is missing"), (spent, value), at, textcoords="axes fraction",
            va="center", fontsize=7, color=COLOURS[peer.kind], arrowprops=line,
        )  # fmt: skip


def dots(ground: Ground, cells: Sequence[Cell]) -> list[tuple[Peer, float, float, str]]:
    """Peer, processor seconds, mean headline, unit, of those that did not run away on any seed that anybody played."""
    found = {}
    for peer in ground.peers:
        done = [
            c
            for c in cells
            if c["ground"] == ground.name and c["peer"] == peer.name and c["status"] == "done"
        ]
        scores = [c["scores"][ground.headline] for c in done if c["scores"].get(ground.headline)]
        values = [s["value"] for s in scores if s["value"] is not None]
        if values:
            mean, spent = sum(values) / len(values), max(seconds(done), 0.1)
            found[peer.name] = len(values), (peer, spent, mean, scores[0]["unit"])
    most = max((count for count, _ in found.values()), default=0)
    return [one for count, one in found.values() if count == most]
