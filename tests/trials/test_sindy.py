"""PySINDy as a namer: where it applies, and that it names what a regression can."""

import numpy as np
import pytest

from gpsim.channels import Channels
from gpsim.recordings import Episode, Recording
from gpsim.trials import sindy


def content(*effects, system="slider"):
    plain = [{"family": f, "on": on, "region": {}, "since": None, "outside": False} for f, on in effects]
    return {"world": {"system": system}, "effects": plain}


def test_it_applies_where_its_library_holds_the_truth():
    assert sindy.applies(content(("viscous_friction", "q"), ("actuator_gain", "force")))
    assert not sindy.applies(content(("actuator_delay", "force")))
    assert not sindy.applies(content(("viscous_friction", "q"), system="unicycle"))
    late = content(("viscous_friction", "q"))
    late["effects"][0]["since"] = 3.0
    assert not sindy.applies(late)


def test_it_names_viscous_friction_in_clean_data():
    pytest.importorskip("pysindy")
    rng, dt, mass, damping = np.random.default_rng(0), 0.01, 2.0, 1.5
    states, actions = [np.zeros(2)], rng.uniform(-5, 5, (2000, 1))
    for (u,) in actions:
        q, v = states[-1]
        decay = np.exp(-damping / mass * dt)
        new = u / damping + (v - u / damping) * decay
        states.append(np.array([q + dt * (v + new) / 2, new]))
    episode = Episode("0", dt * np.arange(2001), np.array(states), actions)
    recording = Recording(
        "slider",
        Channels.of({"q": "m", "q_dot": "m/s"}),
        Channels.of({"force": "N"}),
        (episode,),
        dt,
        {"mass": mass},
    )
    assert sindy.name(recording) == (("viscous_friction", "q"),)
