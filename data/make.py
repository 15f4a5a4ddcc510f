"""Make data/cart.csv: a cart on a track with a hanging pole, as a rig would log it.

Nothing of gpsim is used: the equations are written down once more and stepped at a tenth of a millisecond. What the rig
has and gpsim's simulator `cartpole` has not: dry friction of 2.5 N between cart and track, which holds the cart
while it rests, and a motor that acts 0.03 s late. Sensors are noisy. Run it again and the same bytes come out.
"""

from pathlib import Path

import numpy as np

GRAVITY, CART, POLE, HALF = 9.8, 1.0, 0.1, 0.5  # m/s^2, kg, kg, m: what the simulator believes, too
FRICTION, DELAY = 2.5, 0.03  # N, s: what it does not know
DT, STEP = 0.02, 1e-4  # s: of the log, of the integration
EPISODES, SECONDS = 10, 6.0
NOISE = {"x": 2e-4, "x_dot": 5e-3, "theta": 5e-4, "theta_dot": 1e-2}
LATE = round(DELAY / STEP)


def accelerations(state: np.ndarray, force: float) -> tuple[float, float, float]:
    """Cart's and pole's without friction [m/s^2, rad/s^2], and the force that would hold the cart [N]."""
    _, _, angle, turn = state
    sin, cos = np.sin(angle), np.cos(angle)
    centrifugal = POLE * HALF * turn**2 * sin
    inertia = np.array([[CART + POLE, POLE * HALF * cos], [POLE * HALF * cos, 4 / 3 * POLE * HALF**2]])
    gravity = POLE * GRAVITY * HALF * sin
    cart, pole = np.linalg.solve(inertia, [force + centrifugal, gravity])
    alone = gravity / inertia[1, 1]  # how the pole turns while the cart is held
    return cart, pole, inertia[0, 1] * alone - centrifugal - force


def episode(rng: np.random.Generator) -> list[list[float]]:
    """Rows of t, x, x_dot, theta, theta_dot, force."""
    state = np.array([rng.uniform(-0.3, 0.3), 0.0, np.pi + rng.uniform(-0.8, 0.8), 0.0])
    pending, rows, command = [0.0] * LATE, [], 0.0
    for k in range(round(SECONDS / DT) + 1):
        if k % 15 == 0:  # a new push now and then, towards the middle more often than away
            command = float(np.clip(rng.normal(-3.0 * state[0], 6.0), -10, 10))
        noise = [rng.normal(0.0, size) for size in NOISE.values()]
        rows.append([k * DT, *(state + noise), command])
        for _ in range(round(DT / STEP)):
            pending.append(command)
            state = stepped(state, pending.pop(0))
    return rows


def stepped(state: np.ndarray, force: float) -> np.ndarray:
    """One semi-implicit step; friction may stop the cart, never turn it round."""
    x, speed, angle, turn = state
    cart, pole, held = accelerations(state, force)
    if speed == 0.0 and abs(held) <= FRICTION:
        cart, pole, _ = accelerations(state, force + held)
    else:
        against = -np.sign(speed) if speed else np.sign(held)
        cart, pole, _ = accelerations(state, force + FRICTION * against)
    after = speed + STEP * cart
    if speed * after < 0.0:
        after = 0.0
    turn += STEP * pole
    return np.array([x + STEP * after, after, angle + STEP * turn, turn])


def main() -> None:
    rng = np.random.default_rng(1)
    lines = ["episode,t,x,x_dot,theta,theta_dot,force"]
    for number in range(EPISODES):
        for t, x, speed, angle, turn, force in episode(rng):
            lines.append(f"{number},{t:.2f},{x:.5f},{speed:.4f},{angle:.5f},{turn:.4f},{force:.3f}")
    Path(__file__).with_name("cart.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
