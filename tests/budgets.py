"""The smallest budget of a cart-pole's loop: below the smoke budget, and all parts still run."""

TINY = (
    "budget=smoke",
    "policy.total_steps=640",
    "policy.n_steps=32",
    "evaluate.episodes=12",
    "evaluate.rollouts=6",
    "certify.width=4",
    "diagnose.families.only=[coulomb_friction,actuator_delay]",
    "diagnose.curves.most=0",
)
