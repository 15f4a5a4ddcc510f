"""Trials: concealed worlds with a known truth. Conceal, diagnose blind, reveal, score.

The files, each of which knows only those before it:

    worlds, driving               what a concealed world is, as plain data, and how it is driven
    catalogue                     the catalogue's laws and their strengths, written a second time
    out_of_catalogue*             physics outside the catalogue, a table of kinds
    bodies, truth, shares         what truly happens in a world, and how visible each effect is
    drawing, rough, machines      a world from a seed and a trial's number
    robots                        the same of worlds whose simulator is a MuJoCo model, and how they move
    concealing, blinding          conceal, diagnose blind, reveal
    fits, sindy, judged,          other explanations of a world, equivalents, and another program's
    plan_rivals
    claims, scoring_parts,        one diagnosis against its answer
    scoring
    intervals, figures, summary   figures of all trials, and the goals

Nothing that makes the truth (all up to `robots`) imports `gpsim.effects`, `gpsim.simulators`, `gpsim.mjcf` or
`gpsim.diagnosis`: the laws are written down a second time, so that a mistake in one cannot hide behind the same mistake
in the other. Only the rules for equivalents fit with the diagnosis's engine, after the reveal. `gpsim.diagnosis` can
never import this package, which knows the answers.
"""

__all__ = [
    "blinding", "catalogue", "concealing", "drawing", "figures", "fits", "intervals", "machines", "plan_rivals",
    "robots", "rough", "scoring", "scoring_parts", "summary", "worlds",
]  # fmt: skip
