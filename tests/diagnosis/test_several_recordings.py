"""Several recordings of one machine, judged together: what they share, what is each one's own, what differs."""

from dataclasses import replace

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import gpsim
from gpsim.channels import Channels
from gpsim.diagnosis import Diagnosis, schema
from gpsim.diagnosis.assessment.scoring import expected
from gpsim.diagnosis.data import rebased
from gpsim.diagnosis.fitting import Hypothesis
from gpsim.diagnosis.run import Run
from gpsim.diagnosis.settings import read_settings
from gpsim.diagnosis.setup import prepare
from gpsim.effects import EffectParameter, Term, own_values
from gpsim.errors import UsageError
from gpsim.recordings import HeldOut, apart, joined
from gpsim.reports.account import account_of, differences
from gpsim.reports.account_lines import account_lines
from gpsim.reports.diagnosis_page import page
from gpsim.residuals import first_held_out, held_out_names
from gpsim.simulators import make_simulator

from .worlds import World, record

VALID = Draft202012Validator(schema())
SLIDER = make_simulator("slider")
FORCE = EffectParameter("force", "N", 0.0, 10.0, (1.0,), 0.2)
FEW = {"only": ["coulomb_friction", "parameter_offset on mass", "sensor_bias on q_dot"]}


def rubbed(force, *, mass=2.0, offset=0.0, seed=0, episodes=4, steps=150):
    """A slider with dry friction whose speed is read with an offset."""

    def read(states, times):
        return states + np.array([0.0, offset])

    world = World("slider", {"mass": mass}, grips={0: lambda q, v, normal: force + 0 * q}, sensors=[read])
    return replace(record(world, seed=seed, episodes=episodes, steps=steps), held_out=None)


@pytest.fixture(scope="module")
def days():
    """Friction grew by 14 %, and on Friday the sensor of the speed is off."""
    return {"monday": rubbed(1.0, seed=1), "friday": rubbed(1.14, offset=0.2, seed=2)}


@pytest.fixture(scope="module")
def found(days):
    return gpsim.diagnose(days, families=FEW)


def test_what_differs_is_found_and_told(found):
    friction = next(e for e in found.effects if e.family == "coulomb_friction")
    bias = next(e for e in found.effects if e.family == "sensor_bias")
    assert found.verdict == "named"
    assert len(found.effects) == 2
    assert friction.recordings is None
    sizes = [friction.own.get(day, friction.parameters)["force"].value for day in ("monday", "friday")]
    assert sizes == pytest.approx([1.0, 1.14], rel=0.03)
    assert bias.recordings == ("friday",)
    assert bias.own["friday"]["offset"].value == pytest.approx(0.2, rel=0.05)
    told = account_of(found.result).differs
    assert any(line.startswith("Coulomb friction on q grew by 1") and "to friday" in line for line in told)
    assert any("sensor bias on q_dot differs: none in monday, 0." in line for line in told)


def test_each_recording_is_judged_on_what_it_held_out(found):
    monday, friday = found.result.recordings
    assert (monday.name, friday.name) == ("monday", "friday")
    assert monday.held_out
    assert all(name.startswith("monday/") for name in monday.held_out)
    assert set(found.result.fit.held_out) == {*monday.held_out, *friday.held_out}
    owned = [[own.family for own in recording.own] for recording in (monday, friday)]
    assert "sensor_bias" in owned[1]
    assert sorted(owned[0] + owned[1]) == ["coulomb_friction", "sensor_bias"]
    for recording in (monday, friday):
        assert recording.explained.share > 0.9
        assert recording.rollout["q"].after < 0.3 * recording.rollout["q"].before
        assert recording.from_others is None


def test_the_file_holds_it_and_is_read_again(found, tmp_path):
    content = found.result.to_dict()
    VALID.validate(content)
    assert [one["name"] for one in content["recordings"]] == ["monday", "friday"]
    assert Diagnosis.from_dict(content) == found.result
    loaded = gpsim.Diagnosis.load(found.save(tmp_path / "kept"))
    assert loaded.result.recordings == found.result.recordings
    text = (tmp_path / "kept" / "report.html").read_text(encoding="utf-8")
    assert all(f">{name}</th>" in text for name in ("monday", "friday"))


def test_the_account_keeps_its_place_and_has_a_column_a_recording(found):
    lines = account_lines(account_of(found.result))
    assert len(lines) <= 24
    assert any(line.startswith("Differs") for line in lines)


def test_the_corrected_simulator_is_the_machine_of_the_last_recording(found):
    terms = {t.family: t for t in found._found.corrected(gp=False).terms}
    assert terms["coulomb_friction"].values["force"] == pytest.approx(1.14, rel=0.03)
    assert terms["sensor_bias"].values["offset"] == pytest.approx(0.2, rel=0.05)
    assert all(not t.owners for t in terms.values())


def test_of_three_each_is_foretold_from_the_others():
    """A payload in one of them nobody can know from the others; of the two that are alike they know all."""
    parts = [rubbed(1.0, seed=1, episodes=3), rubbed(1.0, mass=2.6, seed=2, episodes=3), rubbed(1.0, seed=3)]
    found = gpsim.diagnose(dict(zip("abc", parts, strict=True)), families=FEW)
    mass = next(e for e in found.effects if e.family == "parameter_offset")
    assert mass.recordings == ("b",)
    assert mass.own["b"]["ratio"].value == pytest.approx(1.3, rel=0.02)
    shares = [one.from_others.explained.share for one in found.result.recordings]
    assert min(shares[0], shares[2]) > 0.9
    assert shares[1] < min(shares[0], shares[2]) - 0.02
    VALID.validate(found.result.to_dict())


def test_alike_recordings_share_all(days):
    found = gpsim.diagnose([days["monday"], rubbed(1.0, seed=5)], families=FEW)
    assert [e.family for e in found.effects] == ["coulomb_friction"]
    assert found.effects[0].own is None
    assert [one.name for one in found.result.recordings] == ["1", "2"]
    assert account_of(found.result).differs[0].startswith("no differences found")


def test_by_how_much_it_grew_is_told_where_that_is_known(found):
    friction = next(e for e in found.effects if e.family == "coulomb_friction")
    ((day, own),) = friction.own.items()
    unsure = replace(friction, own={day: {"force": replace(own["force"], low=0.1, high=9.0)}})
    (line, *_) = differences(replace(found.result, effects=(unsure,)))
    assert line.startswith("Coulomb friction on q differs: 1")


def test_one_recording_has_no_columns(days):
    found = gpsim.diagnose([days["monday"]], families=FEW)
    assert found.result.recordings is None
    assert "recordings" not in found.result.to_dict()
    assert not any("own" in effect or "recordings" in effect for effect in found.result.to_dict()["effects"])
    assert "Recordings" not in page(found.result, {}, "one")


def test_joined_recordings_keep_what_they_hold_out_and_their_clocks(days):
    late = tuple(replace(e, t=e.t + 1e6) for e in days["friday"].episodes)
    friday = replace(days["friday"], episodes=late, held_out=HeldOut(time_from=1e6 + 2.0))
    whole = joined([days["monday"], friday], ["monday", "friday"])
    assert held_out_names(whole) == ["friday/0", "friday/1", "friday/2", "friday/3", "monday/3"]
    own, origin = rebased(whole)
    assert origin == 0.0
    assert max(e.t[0] for e in own.episodes) == 0.0
    assert (first_held_out(own) == first_held_out(whole)).all()
    assert [len(part.episodes) for part in apart(own)] == [4, 4]
    assert (own.sources[1].held_out.time_from, own.sources[0].held_out) == (pytest.approx(2.0), None)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"system": "pendulum"}, "differ in system (slider and pendulum)"),
        ({"dt": 0.05}, "a has a step of 0.02 s, b of 0.05 s"),
        (
            {"state": Channels.of({"q": "cm", "q_dot": "m/s"})},
            "differ in state ((q [m], q_dot [m/s]) and (q [cm]",
        ),
        ({"parameters": {"mass": 3.0}}, "differ in mass of the base simulator (2.0 and 3.0)"),
        ({"integrator": "rk4"}, "differ in integrator"),
        ({"velocities": "differentiated"}, "differ in velocities"),
    ],
)
def test_recordings_that_do_not_go_together(days, change, said):
    with pytest.raises(UsageError) as error:
        joined([days["monday"], replace(days["friday"], **change)], ["a", "b"])
    assert said in str(error.value)
    assert "--each" in str(error.value)
    assert "\n" not in str(error.value)


def test_own_values_stand_in_the_place_of_shared_ones():
    term = Term("coulomb_friction", "q", {"force": 1.0, "force@1": 2.0})
    assert term.owners == (1,)
    assert [term.in_recording(k).values for k in (0, 1, None)] == [{"force": v} for v in (1.0, 2.0, 1.0)]
    rows = {"force": np.full(3, 1.0), "force@2": np.full(3, 5.0)}
    assert own_values(rows, np.array([0, 2, 1]))["force"].tolist() == [1.0, 5.0, 1.0]
    assert own_values(rows, None)["force"].tolist() == [1.0, 1.0, 1.0]


def test_a_hypothesis_gives_takes_and_shares_own_values():
    shared = Hypothesis((Term("coulomb_friction", "q", {"force": 1.0}),), ((FORCE,),))
    own = shared.with_own(0, 1).having(np.array([1.0, 3.0]))
    assert own.theta.tolist() == [1.0, 3.0]
    assert own.names == ("coulomb_friction on q (own in recording 2)",)
    assert own.in_recording(1).theta.tolist() == [3.0]
    assert own.in_recording(0) == shared
    nothing = own.having(np.array([0.0, 3.0]))
    assert nothing.in_recording(0).terms == ()  # what does nothing there is not said of it


def test_what_others_say_of_one_is_what_they_share_or_their_mean():
    friction = Term("coulomb_friction", "q", {"force": 1.0, "force@1": 2.0, "force@2": 4.0})
    bias = Term("sensor_bias", "q", {"offset": 0.0, "offset@0": 0.3})
    account = Hypothesis((friction, bias), ((), ()))
    foretold = expected(account, 0, 3)
    assert foretold.terms[0].in_recording(0).values["force"] == 3.0
    assert foretold.terms[1].in_recording(0).values["offset"] == 0.3
    assert expected(account, 1, 3).terms[0].in_recording(1).values["force"] == 1.0


def test_compiled_code_knows_whose_value_it_is(days):
    """Each window moves by its recording's own values, with and without compiled code."""
    whole = joined(list(days.values()), list(days))
    problem = prepare(whole, SLIDER, SLIDER.defaults(whole.parameters)).searched
    term = Term("coulomb_friction", "q", {"force": 0.5, "force@1": 2.0})
    mixed = Hypothesis((term,), ((FORCE,),))
    starts = problem.windows.measured[:, 0]

    def left(hypothesis, compiled):
        run = Run(read_settings({"windows": {"compiled": compiled}}))
        return replace(problem, run=run).residuals(hypothesis, hypothesis.theta[None], starts[None])[0]

    alone = [Hypothesis((term.in_recording(k),), ((FORCE,),)) for k in (0, 1)]
    for compiled in (False, True):
        whole_of_it = left(mixed, compiled)
        for k, hypothesis in enumerate(alone):
            rows = problem.windows.source == k
            assert rows.any()
            assert np.array_equal(whole_of_it[rows], left(hypothesis, compiled)[rows])


def test_a_recording_that_says_it_holds_out_something_must(days):
    late = replace(days["friday"], held_out=HeldOut(time_from=1e6))
    with pytest.raises(UsageError, match="friday: nothing is held out"):
        gpsim.diagnose({"monday": days["monday"], "friday": late}, families=FEW)
