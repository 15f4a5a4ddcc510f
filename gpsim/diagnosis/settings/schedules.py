"""How far fits are taken, by purpose: the most Gauss-Newton steps, and the gain of a step that is the last.

A schedule is one of each: many hypotheses are glanced at roughly, the better ones settle, what is compared with the
leader is refitted, and what leads is finished (successive halving).
"""

GLANCE = 5  # steps of a first look at many hypotheses, and where little moves
TRIAL = 6  # steps of a first look at what has one term less, or one behind a gate
SETTLE = 8  # steps more of those that promise most, and where one thing changes
THRESHOLDS = 9  # steps where thresholds of jumping laws are looked for anew
REFIT = 12  # steps of a fit that is compared with the leader
FINISH = 17  # steps more of what leads
ROUGH = 0.5  # gain of the last step where hypotheses are ranked [nats]
EDGE = 0.2  # gain of the last step where the edges of a gate move [nats]
CLOSE = 0.1  # gain of the last step where a term may not be needed [nats]
FINAL = 0.02  # gain of the last step of what leads [nats]
