"""docs/index.md: every page by its title."""

from mkdocs_hooks import DOCS, FOLDERS, pages_of, title_of

from . import MADE

HEAD = """# gpsim

**Your simulator and your robot disagree. gpsim says why.** It compares a recording with the simulator and names the
physics that is missing, such as friction, an actuator delay or a wrong mass, with sizes and error bars. A Gaussian
process learns the rest. You get a corrected simulator in which to train policies.

![The account of a cart on a track: dry friction and an actuator delay are missing](images/diagnosis.png)

    gpsim diagnose data/cart.csv --simulator cartpole       # a log -> the missing physics, with sizes
    gpsim run full-loop experiment=cartpole                 # the loop: record, diagnose, train, compare

Start with [a first diagnosis in ten minutes](tutorial/first_diagnosis.md), or look at
[a gallery of accounts](gallery.md), right and wrong.

![Score against processor time for every method on seven tasks](images/peers.svg)

[The comparison with other methods](method/peers.md) and the
[results](results.md) give each number with its command."""
WHAT = {
    "tutorial": "Follow these pages from the first line to the last.",
    "how-to": "Each page solves one task.",
    "reference": "Look up commands, settings, files and terms.",
    "method": "How it works, and how far to trust it.",
}


def index_page() -> str:
    """A list a folder, in the order of the site."""
    parts = [HEAD]
    for folder, title in FOLDERS.items():
        lines = [f"- [{title_of(DOCS / name)}]({name})" for name in pages_of(folder)]
        parts.append(f"## {title}\n\n{WHAT[folder]}\n\n" + "\n".join(lines))
    parts.append(
        "## Results\n\n- [Results](results.md): each number with the command that makes it.\n"
        "- [Gallery](gallery.md): accounts, right and wrong."
    )
    return "\n\n".join([*parts, MADE.format(source="the pages themselves")]) + "\n"
