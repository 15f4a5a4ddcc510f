import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsim.errors import UsageError
from gpsim.recordings import open_log


def table(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def columns(path, *names, salvage=False):
    log = open_log(path, salvage=salvage)
    [topic] = log.topics()
    series = log.series({topic.name: names or topic.fields})[topic.name]
    return {name: values.tolist() for name, values in series.fields.items()}


@pytest.mark.parametrize(
    "text",
    [
        "t,x\n0,1.5\n1,2.5\n",
        "# made by hand\n# unit: s\nt,x\n0,1.5\n1,2.5\n",
        "t;x\n0;1,5\n1;2,5\n",
        "t\tx\n0\t1.5\n1\t2.5\n",
        "t x\n0 1.5\n1  2.5\n",
        "t|x\r\n0|1.5\r\n1|2.5\r\n",
        '\ufeff"t", "x"\n0, 1.5\n1, 2.5\n\n\n',
        "# t,x\n0,1.5\n1,2.5",
        "0,1.5\n1,2.5\n",
    ],
)
def test_text_tables_however_they_are_written(tmp_path, text):
    path = table(tmp_path / "log.csv", text)
    names = ("t", "x") if "t" in text else ("column_0", "column_1")
    assert columns(path) == dict(zip(names, ([0.0, 1.0], [1.5, 2.5]), strict=True))
    [topic] = open_log(path).topics()
    assert (topic.name, topic.count, topic.start, topic.has_header) == ("log", 2, None, False)


def test_words_are_no_columns_flags_and_gaps_are(tmp_path):
    path = table(tmp_path / "a.csv", "t,mode,on,gap,,u\n0,idle,True,1,,9\n1,run,False,,,8\n")
    log = open_log(path)
    [topic] = log.topics()
    assert topic.fields == ("t", "on", "gap", "u")
    series = log.series({"a": topic.fields})["a"]
    assert series.fields["on"].tolist() == [1.0, 0.0]
    assert np.isnan(series.fields["gap"][1])
    assert series.absent == {"gap": 1}
    assert series.type == "table"


def test_a_cell_that_is_no_number_is_told_with_its_line(tmp_path):
    path = table(
        tmp_path / "a.csv", "# c\nt,x\n" + "".join(f"{i},{i}.5\n" for i in range(50)) + "50,oops\n51,51.5\n"
    )
    with pytest.raises(UsageError, match=r"line 53, column x: 'oops'.*--salvage"):
        columns(path)
    log = open_log(path, salvage=True)
    series = log.series({"a": ["t", "x"]})["a"]
    assert series.dropped == {"a cell is not a number": 1}
    assert series.fields["t"].tolist() == [*range(50), 51]


def test_wrong_columns_and_tables_are_one_line(tmp_path):
    path = table(tmp_path / "a.csv", "time,angle\n0,1\n1,2\n")
    with pytest.raises(UsageError, match=r"no numeric column 'angel'; there are: angle"):
        columns(path, "angel")
    with pytest.raises(UsageError, match="no table 'b'"):
        open_log(path).series({"b": ["time"]})


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=20),
    st.sampled_from(",;\t|"),
)
def test_numbers_come_back_to_the_last_bit(tmp_path_factory, values, mark):
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    table(path, f"i{mark}x\n" + "".join(f"{i}{mark}{value!r}\n" for i, value in enumerate(values)))
    assert columns(path, "x")["x"] == values


def test_parquet(tmp_path):
    frame = pd.DataFrame({"t": np.arange(5.0), "n": np.arange(5), "ok": [True] * 5, "word": list("abcde")})
    frame["when"] = pd.to_datetime([1_000_000_000 * i + 500_000_000 for i in range(5)])
    frame.loc[2, "t"] = np.nan
    frame.to_parquet(tmp_path / "a.parquet")
    log = open_log(tmp_path / "a.parquet")
    [topic] = log.topics()
    assert topic.fields == ("t", "n", "ok", "when")
    series = log.series({"a": topic.fields})["a"]
    assert series.fields["when"].tolist() == [0.5, 1.5, 2.5, 3.5, 4.5]
    assert series.fields["ok"].sum() == 5
    assert np.isnan(series.fields["t"]).tolist() == [False, False, True, False, False]


def test_matlab_of_another_version_is_told(tmp_path):
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + b"\x89HDF\r\n\x1a\n"
    (tmp_path / "hdf.mat").write_bytes(head + bytes(600))
    with pytest.raises(UsageError, match="-v7"):
        open_log(tmp_path / "hdf.mat")


@pytest.mark.parametrize("compressed", [False, True])
def test_matlab(tmp_path, compressed):
    path = tmp_path / "log.mat"
    held = {
        "t": np.arange(100.0).reshape(-1, 1),
        "q": np.arange(200.0).reshape(100, 2),
        "mass": 95.1,
        "name": "slide",
        "run": {"u": np.ones((1, 100))},
        "short": np.arange(7),
    }
    scipy.io.savemat(path, held, do_compression=compressed)
    log = open_log(path)
    topics = {topic.name: topic for topic in log.topics()}
    assert set(topics) == {"log", "log.7"}
    assert set(topics["log"].fields) == {"t", "q.0", "q.1", "run.u"}
    series = log.series({"log": ["t", "q.1"]})["log"]
    np.testing.assert_array_equal(series.fields["q.1"], np.arange(1.0, 200.0, 2.0))


def test_a_column_that_begins_late_is_one(tmp_path):
    lines = [f"{i},{'' if i < 2500 else i}," for i in range(3000)]
    path = table(tmp_path / "a.csv", "t,late,never\n" + "\n".join(lines) + "\n")
    late = columns(path, "late")["late"]
    assert np.isnan(late[:2500]).all()
    assert late[2500:] == [float(i) for i in range(2500, 3000)]


def test_a_decimal_comma_survives_a_cell_that_is_none_and_whole_numbers_before_it(tmp_path):
    path = table(tmp_path / "a.csv", "t;x\n0;0,5\n1;ERR\n2;2,5\n")
    assert columns(path, salvage=True) == {"t": [0.0, 2.0], "x": [0.5, 2.5]}
    with pytest.raises(UsageError, match="line 3.*'ERR'"):
        columns(path)
    whole = "".join(f"{i};{i}\n" for i in range(60))
    assert columns(table(tmp_path / "b.csv", f"t;x\n{whole}60;0,5\n"))["x"][-1] == 0.5


def test_a_hash_in_a_cell_cuts_nothing_off(tmp_path):
    path = table(tmp_path / "a.csv", "# made by hand\nt,mode,x\n0,run #1,1.5\n# a pause\n1,run #2,2.5\n")
    assert columns(path, "t", "x") == {"t": [0.0, 1.0], "x": [1.5, 2.5]}
    noted = table(tmp_path / "b.csv", "t,x\n0,1.5 # begin\n1,2.5\n")
    assert columns(noted) == {"t": [0.0, 1.0], "x": [1.5, 2.5]}


@pytest.mark.parametrize(("header", "end", "count"), [("t,x,y", "1,2,3\n2,3e", 2), ("t,x,y", "1,2,3\n2", 1)])
def test_a_last_line_that_was_cut_is_lost_alone_and_counted(tmp_path, header, end, count):
    path = table(tmp_path / "a.csv", f"{header}\n0,1,2\n{end}")
    with pytest.raises(UsageError, match=f"the last line has {count} of 3 cells"):
        open_log(path)
    log = open_log(path, salvage=True)
    series = log.series({"a": ("t", "x", "y")})["a"]
    assert series.fields["t"].tolist() == [0.0, 1.0]
    assert not series.dropped
    assert log.losses == {f"the last line has {count} of 3 cells": 1}


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"a,b\n1,\x00\n", "byte 6 is zero"),
        (b"1" * (1 << 20), "longer than"),
        (b"# only\n# this\n", "no table"),
        (b"t\tx\n0.01\t998\n0.02\t1,001\n", "without thousands separators"),
    ],
)
def test_no_text_table(tmp_path, data, says):
    (tmp_path / "a.csv").write_bytes(data)
    with pytest.raises(UsageError, match=says):
        open_log(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("header", "says"),
    [
        ("t,x,y,x", r"several columns are called 'x' \(columns 2, 4\)"),
        ("t,x,x,t", r"'t' \(columns 1, 4\), 'x' \(columns 2, 3\)"),
        ("column_3,x,y,", r"'column_3' \(columns 1, 4\)"),
        ("t,x\a,y,z", r"column 2: the name 'x\?' holds a line break or control character \('\\x07'\)"),
        (f"t,{'x' * 300},y,z", "column 2: the name 'x{40}\\.\\.\\.' has 300 characters"),
    ],
)
def test_columns_whose_names_cannot_be_told_apart_or_shown_are_refused(tmp_path, header, says):
    for text in (f"{header}\n0,1,2,3\n1,2,3,4\n", f"# {header}\n0,1,2,3\n1,2,3,4\n"):
        if text.startswith("#") and header.endswith(","):
            continue  # a comment with an empty cell is no header
        with pytest.raises(UsageError, match=says) as caught:
            open_log(table(tmp_path / "a.csv", text))
        assert "\n" not in str(caught.value)


def test_columns_of_one_name_are_refused_in_parquet_and_matlab(tmp_path):
    twice = pa.Table.from_arrays([pa.array([1.0, 2.0])] * 2, names=["t", "t"])
    pq.write_table(twice, tmp_path / "a.parquet")
    with pytest.raises(UsageError, match=r"a\.parquet: several columns are called 't' \(columns 1, 2\)"):
        open_log(tmp_path / "a.parquet")
    pq.write_table(twice.rename_columns(["t", "x\ny"]), tmp_path / "b.parquet")
    with pytest.raises(UsageError, match=r"column 2: the name 'x y' holds a line break"):
        open_log(tmp_path / "b.parquet")
    scipy.io.savemat(tmp_path / "d.mat", {"q": np.ones((5, 2)), "q.0": np.arange(5.0)})
    with pytest.raises(UsageError, match=r"d\.mat: several columns are called 'q\.0' \(columns 1, 3\)"):
        open_log(tmp_path / "d.mat")
