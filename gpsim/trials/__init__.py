"""Trials: concealed worlds with a known truth. Conceal, diagnose blind, reveal, score.

The rooms, each of which knows only those before it:

    worlds      what a concealed world is, as plain data
    catalogue   the catalogue's laws and their strengths, written a second time
    outside     physics outside the catalogue, a class a kind
    truth       what truly happens in a world, and how visible each effect is
    drawing     a world from a seed and a trial's number
    robots      the same of worlds whose simulator is a MuJoCo model, and how they move
    blinding    conceal, diagnose blind, reveal
    rivals      other explanations of a world, and another program's
    scoring     one diagnosis against its answer
    statistics  figures of all trials, and the goals

Nothing that makes the truth (all up to `robots`) imports `gpsim.effects`, `gpsim.simulators`, `gpsim.mjcf` or
`gpsim.diagnosis`: the laws are written down a second time, so that a mistake in one cannot hide behind the same mistake
in the other. Only the rules for equivalents in `rivals` fit with the diagnosis's engine, after the reveal.
`gpsim.diagnosis` can never import this package, which knows the answers.
"""
