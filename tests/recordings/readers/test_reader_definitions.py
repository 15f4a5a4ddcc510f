"""Message definitions are code in the making: made to harm, they are refused, soon and without running."""

import pytest
from bags import EPOCH
from mcap_writer import Chunks, write_mcap
from mutations import Outcomes, deadline, watch

from gpsim.errors import UsageError
from gpsim.recordings.readers import open_log


def with_definition(path, name, definition, data=bytes(64)):
    rows = [(EPOCH + i, "/x", b"\x00\x01\x00\x00" + data) for i in range(3)]
    path.write_bytes(write_mcap({"/x": name}, {name: definition}, rows, Chunks()))
    return path


SEPARATOR = "=" * 80
NESTED = "\n".join(
    [
        f"a/T1[1000] x\n{SEPARATOR}",
        *(f"MSG: a/T{i}\na/T{i + 1}[1000] x\n{SEPARATOR}" for i in range(1, 9)),
        "MSG: a/T9\nuint8 y",
    ]
)
DEEP = "\n".join(
    [
        f"a/T1 x\n{SEPARATOR}",
        *(f"MSG: a/T{i}\na/T{i + 1} x\n{SEPARATOR}" for i in range(1, 200)),
        "MSG: a/T200\nuint8 y",
    ]
)


@pytest.mark.parametrize(
    ("definition", "says"),
    [
        ("string[900000000] x", "expands to"),
        (NESTED, "expands to"),
        (DEEP, "nested"),
        ("a/X x", "contains itself"),
        (f"a/E[] x\n{SEPARATOR}\nMSG: a/E\n", "too many fields for its bytes"),
        ("uint8 x\nuint16 x\n", "conflicting"),
        ("float64 x\n" * 60_000, "bytes long|longer than"),
        ("uint8[ x", "cannot be parsed"),
        ("b/Unknown x", "lacks b/msg/Unknown"),
        ("string x\nuint8 y", "not a a/msg/X"),
    ],
)
def test_definitions_made_to_harm(tmp_path, definition, says):
    path = with_definition(tmp_path / "x.mcap", "a/msg/X", definition, b"\xff" * 64)
    with deadline(20.0):
        try:
            [topic] = open_log(path).topics()
            field = (*topic.fields, "x")[0]
            with pytest.raises(UsageError, match=says):
                open_log(path).series({"/x": [field]})
        except UsageError as error:
            assert says.split("|")[1] in str(error)  # the file may be refused as a whole
    outcomes = Outcomes()
    watch(path, "definition", outcomes)
    assert not outcomes.faults


def test_a_definition_cannot_run_code(tmp_path):
    ran = tmp_path / "ran"
    code = f"a/msg/X:\n  import pathlib; pathlib.Path({str(ran)!r}).touch()\nclass b/msg/Y"
    for name in (code, "a/msg/X'''", "__import__('os')/msg/X"):
        path = with_definition(tmp_path / "x.mcap", name, "uint8 x")
        outcomes = Outcomes()
        watch(path, "code", outcomes)
        assert not outcomes.faults
    assert not ran.exists()


def test_definitions_that_take_long_to_parse(tmp_path):
    for blank in ("\n" * 200_000, " # x\n" * 50_000, "\t\n" * 100_000):
        path = with_definition(tmp_path / "x.mcap", "a/msg/X", blank + "uint8 y", b"\x07")
        with deadline(5.0):
            assert open_log(path).series({"/x": ["y"]})["/x"].fields["y"].tolist() == [7.0] * 3
