"""The same effect on many joints is one group: a row, and each joint with its size."""

from made_diagnoses import made_diagnosis
from rich_diagnoses import friction, gain, share, size

from gpsim.reports.account import account_of
from gpsim.reports.account_lines import COLUMNS, LINES, account_lines

JOINTS = [f"joint_with_a_long_name_{i}" for i in (10, 2, 1, 3, 4, 5)]


def _arm(**changes):
    frictions = [
        friction(
            on=joint,
            site="force",
            parameters={"force": size(1.0 + i, 0.05, "N m")},
            importance=share(0.1),
            **changes,
        )
        for i, joint in enumerate(JOINTS)
    ]
    return made_diagnosis(verdict="named", effects=(*frictions, gain(role="headline")))


def test_friction_on_six_joints_is_one_row_with_a_size_each():
    group, other = account_of(_arm()).rows
    assert group.effect == "Coulomb friction on 6 joints"
    assert [name for name, _ in group.members] == sorted(JOINTS, key=lambda n: int(n.rpartition("_")[2]))
    assert group.members[-1] == (JOINTS[0], "1.00 ± 0.05 N m")
    assert (group.percent, other.members) == ("60 %", ())


def test_the_terminal_wraps_the_joints_and_cuts_no_name():
    lines = account_lines(account_of(_arm()))
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= COLUMNS
    assert all(any(f"{joint} " in line for line in lines) for joint in JOINTS)


def test_what_acts_in_a_place_only_stands_by_itself():
    rows = account_of(_arm(region={"x": (0.0, 1.0)})).rows
    assert len(rows) == 7
    assert not any(row.members for row in rows)
