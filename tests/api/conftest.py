"""One small recording and its diagnosis, made once with what `import gpsim` offers."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import gpsim

UNITS = {"q": "m", "q_dot": "m/s", "force": "N"}
FEW = ["viscous_friction", "coulomb_friction", "quadratic_drag", "spring", "actuator_gain"]
DAMPING = 1.0  # N s/m, which no simulator here knows


def pushed(count=300, dt=0.02, seed=0, damping=DAMPING):
    """A body of 1 kg, damped, pushed by forces that are held for 0.4 s."""
    rng = np.random.default_rng(seed)
    force = np.repeat(rng.uniform(-2, 2, -(-count // 20)), 20)[:count]
    q = q_dot = 0.0
    rows = []
    for k in range(count):
        rows.append((dt * k, q, q_dot, force[k]))
        for _ in range(10):
            q_dot += dt / 10 * (force[k] - damping * q_dot)
            q += dt / 10 * q_dot
    log = pd.DataFrame(rows, columns=["t", "q", "q_dot", "force"])
    return log.assign(q=log.q + rng.normal(0, 1e-4, count), q_dot=log.q_dot + rng.normal(0, 1e-3, count))


@pytest.fixture(scope="module", autouse=True)
def _sketched():
    """Figures are drawn: what is diagnosed here is compared with what the command line makes in another process."""


@pytest.fixture(scope="session")
def log():
    return pushed()


@pytest.fixture(scope="session")
def made(log, tmp_path_factory):
    """The diagnosis as it was made, what its progress said, and a folder with slider.csv and found/ in it."""
    folder = tmp_path_factory.mktemp("api")
    log.to_csv(folder / "slider.csv", index=False)
    said = []
    recording = gpsim.recording_from_frame(log, UNITS, "slider")
    diagnosis = gpsim.diagnose(recording, families={"only": FEW}, progress=lambda *words: said.append(words))
    diagnosis.save(folder / "found")
    return SimpleNamespace(folder=folder, diagnosis=diagnosis, recording=recording, said=said)


@pytest.fixture
def here(made, tmp_path):
    """The working folder, with slider.csv and found/ in it."""
    shutil.copy(made.folder / "slider.csv", tmp_path)
    shutil.copytree(made.folder / "found", tmp_path / "found")
    return Path(tmp_path)
