"""Effects that users bring: a class in a file, what is wrong with one in a line, trust, and loading it again."""

import json
import textwrap
from multiprocessing.reduction import ForkingPickler

import numpy as np
import pytest

import gpsim.effects
from gpsim import trust
from gpsim.corrected import EffectsPlant, describe, plant_from
from gpsim.effects import (
    CATALOGUE,
    FAMILIES,
    INPUTS,
    Chain,
    Term,
    again,
    bring,
    brought,
    consent_to,
    read_effects,
    template,
)
from gpsim.errors import UsageError
from gpsim.kernels import program_of
from gpsim.simulators import make_simulator

SLIDER = make_simulator("slider")
CABLE = '''
import numpy as np

class Cable:
    """It pulls back: -k max(q, 0)."""

    site = "force"
    of = "position"
    parameters = {"weight": ("N/m", 0.0, 50.0, 1.0)}

    def law(self, q, speed, weight):
        return -weight * np.maximum(q, 0.0)
'''


@pytest.fixture(autouse=True)
def _forgotten(monkeypatch, tmp_path):
    """No family and no word of trust outlives a test."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(trust, "allowed", set())
    monkeypatch.setattr(brought, "_standing", {})
    before = dict(FAMILIES)
    yield
    FAMILIES.clear()
    FAMILIES.update(before)


@pytest.fixture
def file(tmp_path):
    def write(text, name="my_effects.py"):
        path = tmp_path / name
        path.write_text(textwrap.dedent(text))
        consent_to(str(path))
        return str(path)

    return write


def test_a_class_of_a_few_lines_acts_as_its_law_says(file):
    """A slider of 2 kg on a spring of one side: a cosine while q > 0."""
    assert bring(read_effects(file(CABLE))) == ("cable",)
    chain = Chain(SLIDER, {"mass": 2.0}, (Term("cable", "q", {"weight": 8.0}),), "fine", 0.02)
    state, values, step = np.array([[0.5, 0.0]]), [{"weight": np.array([8.0])}], np.array([0.005])
    for i in range(100):
        state = chain.advance(state, np.zeros((1, 1)), values, step, np.array([i * 0.005]))
    np.testing.assert_allclose(state[0], [0.5 * np.cos(1.0), -np.sin(1.0)], rtol=1e-5)
    assert program_of(chain) is None  # NumPy does it
    assert not FAMILIES["cable"].asked  # by nobody but who brought it


def test_an_actuator_remembers_in_arrays_of_each_run(file):
    (one,) = read_effects(
        file("""
        class Sluggish:
            site = "actuator"
            parameters = {"share": ("1", 0.0, 1.0, 0.5)}
            memory = ("level",)

            def law(self, u, share, memory, step):
                memory["level"] += (1.0 - share) * (u - memory["level"])
                return memory["level"].copy()
        """)
    )
    effect, u = one.effect, np.ones((2, 3))
    values, step = {"share": np.array([[0.5], [0.0]])}, np.full((2, 3), 0.01)
    for _ in range(2):  # a second run begins anew
        said = effect.actuate(u, values, effect.begin(2, 0.1, 0.01), step, step)
        np.testing.assert_allclose(said, [[0.5, 0.75, 0.875], [1, 1, 1]])
    assert effect.remembers(values) == np.inf


@pytest.mark.parametrize("site", INPUTS)
def test_what_new_writes_passes_every_check_and_its_own_test(site, tmp_path, monkeypatch):
    texts = template("rubber_band", site)
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(__import__("sys").modules, "rubber_band", raising=False)
    path = str(tmp_path / "rubber_band.py")
    consent_to(path)
    assert [c for c in gpsim.effects.check(path) if c.wrong] == []
    own = {"__name__": "test_rubber_band"}
    exec(compile(texts["test_rubber_band.py"], "test_rubber_band.py", "exec"), own)
    own["test_the_law"]()
    own["test_gpsim_takes_it"]()


GOOD = {
    "site": '"force"',
    "parameters": '{"weight": ("N/m", 0.0, 50.0, 1.0)}',
    "law": "lambda self, q, speed, weight: -weight * q",
}


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"site": '"wing"'}, "'site' must be one of force, friction"),
        ({"parameters": "{}"}, "'parameters' must be name: (unit, low, high, start)"),
        ({"parameters": '{"weight": 3.0}'}, r"parameters['weight'] must be name"),
        ({"parameters": '{"weight": ("N/m", 0.0, 50.0, 80.0)}'}, "finite numbers low <= start <= high"),
        (
            {"parameters": '{"weight": ("N/m", 1.0, 50.0, 2.0)}'},
            "has no effect at 0, which is outside 1 to 50",
        ),
        ({"law": "None"}, "it needs a method law(self, q, speed, weight)"),
        ({"law": "lambda self, q, weight: q"}, "law must take (q, speed, weight), got (q, weight)"),
        (
            {"law": "lambda self, q, speed, weight: q[:1]"},
            "law must return 33 numbers, one per row of the batch",
        ),
        ({"law": "lambda self, q, speed, weight: q * 1j"}, "law is complex"),
        ({"law": "lambda self, q, speed, weight: 1 / 0"}, "law raised ZeroDivisionError"),
        ({"law": "lambda self, q, speed, weight: q.sort()"}, "law raised ValueError"),
        ({"memory": '("level",)'}, "only actuators have 'memory'"),
        ({"family": '"spring"'}, "the catalogue already has a family 'spring'"),
        ({"family": '"My Spring"'}, "'family' must consist of lower-case letters"),
    ],
)
def test_a_wrong_class_is_one_line_with_what_is_at_fault(file, change, fault):
    lines = "\n".join(f"    {name} = {value}" for name, value in {**GOOD, **change}.items())
    path = file(f"class Cable:\n{lines}\n")

    def ask():
        bring(read_effects(path))
        gpsim.effects.check(f"{path}:Cable")

    with pytest.raises(UsageError) as raised:
        ask()
    assert fault in str(raised.value)
    assert f"{path}:Cable" in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("law", "question"),
    [
        ("-weight * q + 0.1", "nothing at neutral parameters"),
        ("-weight * (q - q.mean())", "batch = loop"),
        ("-weight * q / (weight - 50.0)", "finite"),
    ],
)
def test_what_a_law_does_wrong_has_a_check_that_says_so(file, law, question):
    path = file(CABLE.replace("-weight * np.maximum(q, 0.0)", law))
    with np.errstate(all="ignore"):
        wrong = [c.question for c in gpsim.effects.check(f"{path}:Cable") if c.wrong]
    assert question in wrong


def test_a_law_that_keeps_what_it_saw_does_not_reset(file):
    path = file("""
    class Tired:
        site = "actuator"
        parameters = {"loss": ("1", 0.0, 1.0, 0.5)}
        seen = 0.0

        def law(self, u, loss):
            self.seen += 1.0
            return u * (1.0 - loss) ** self.seen
    """)
    wrong = {c.question for c in gpsim.effects.check(f"{path}:Tired") if c.wrong}
    assert "memory resets" in wrong


def test_a_file_that_only_data_name_does_not_run(file, monkeypatch):
    path = file(CABLE)
    bring(read_effects(path))
    plant = EffectsPlant(SLIDER, {"mass": 1.0}, (Term("cable", "q", {"weight": 2.0}),), "fine", 2, 0.02)
    kept = json.loads(json.dumps(describe(plant, gp=False)))
    assert set(kept["effects"]) == {"cable"}
    monkeypatch.setattr(trust, "allowed", set())
    monkeypatch.setenv("XDG_CONFIG_HOME", str(path) + ".config")
    with pytest.raises(UsageError, match="not run: the file .* --effects"):
        again(kept["effects"], "DIR")
    with trust.trusting():
        bring(again(kept["effects"], "DIR"))
    assert plant_from(kept, SLIDER).terms == plant.terms


def test_a_file_that_has_changed_since_is_another_effect(file, tmp_path):
    path = file(CABLE)
    bring(read_effects(path))
    kept = gpsim.effects.origins(["cable", "spring"])
    assert list(kept) == ["cable"]
    (tmp_path / "my_effects.py").write_text(CABLE.replace("-weight", "-2.0 * weight"))
    consent_to(path)
    with pytest.raises(UsageError, match="is from an earlier version of"):
        again(kept, "DIR")


def test_installed_packages_name_theirs(file, monkeypatch):
    class Point:
        name, value = "cable", "cables:Cable"

        def load(self):
            class Cable:
                site, parameters = "force", {"weight": ("N/m", 0.0, 50.0, 1.0)}

                def law(self, q, speed, weight):
                    return -weight * q

            return Cable

    monkeypatch.setattr(brought, "entry_points", lambda group: [Point()])
    (one,) = brought.installed()
    assert (one.effect.family, one.reference, one.from_file) == ("cable", "cables:Cable", False)
    bring([one])
    assert again(gpsim.effects.origins(["cable"]), "DIR") == ()


def test_the_catalogue_is_not_touched(file):
    before = dict(CATALOGUE)
    bring(read_effects(file(CABLE)))
    assert before == CATALOGUE
    assert set(FAMILIES) - set(CATALOGUE) == {"cable"}


def test_another_process_knows_an_effect_of_ones_own_by_its_family(file):
    bring(read_effects(file(CABLE)))
    there = ForkingPickler.loads(ForkingPickler.dumps(FAMILIES["cable"]))
    assert there is FAMILIES["cable"]
