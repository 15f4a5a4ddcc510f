"""docs/index.md: every page by its title."""

from mkdocs_hooks import DOCS, FOLDERS, pages_of, title_of

from . import MADE

HEAD = f"""# gpsim

{MADE.format(source="the pages themselves")}

gpsim finds the physics that a simple simulator left out, from recordings of the real thing. It names effects with
their sizes, learns the rest with a Gaussian process, and trains policies in the corrected simulator.

![What a diagnosis says of a cart on a track](images/diagnosis.png)

    gpsim diagnose data/cart.csv --simulator cartpole       # a log -> which physics is missing, how much, how sure
    gpsim run full-loop experiment=cartpole                 # the whole loop: record, diagnose, train, compare"""
WHAT = {
    "tutorial": "To learn it: pages to follow from the first line to the last.",
    "how-to": "To do one thing.",
    "reference": "To look something up.",
    "method": "To understand how it works, and how far to trust it.",
}


def index_page() -> str:
    """A list a folder, in the order of the site."""
    parts = [HEAD]
    for folder, title in FOLDERS.items():
        lines = [f"- [{title_of(DOCS / name)}]({name})" for name in pages_of(folder)]
        parts.append(f"## {title}\n\n{WHAT[folder]}\n\n" + "\n".join(lines))
    parts.append(
        "## Results\n\n[What was measured](results.md), each figure with the command that makes it. "
        "[A gallery](gallery.md) of accounts, right and wrong."
    )
    return "\n\n".join(parts) + "\n"
