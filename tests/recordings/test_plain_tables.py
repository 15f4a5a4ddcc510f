"""A small table of numbers is read without pandas, to the same values and the same errors."""

import subprocess
import sys

import numpy as np
import pytest

from gpsim.errors import UsageError
from gpsim.recordings.table_files import columns_of, read_exactly, read_frame

HEAD = "episode,t,q\n"


@pytest.mark.parametrize(
    "text",
    [
        HEAD + "007,0,1e-3\n007,0.1,+1E5\n1,.2,-0.0\n\n1,3.,12345678901234567\n1,4,\n",
        HEAD + "0,0,0.1\n0,1,18446744073709551615\n0,2,123456789012345678901234567890\n0,3,1e400",
        HEAD.replace("\n", "\r\n") + "0,0,1\r\n0,1,2\r\n",
        "\n" + HEAD + "0,0,1\n",
        HEAD + "0,0,high\n",
        HEAD + "0,0,1e\n",
        HEAD + "0,0,1-2\n",
        HEAD + "NA,0,1\n",
        HEAD + ",0,1\n",
        HEAD + "0,0\n",
        HEAD + "0,0,1,2\n",
        HEAD + "0,0,1\n0,0,1,2\n",
        '"episode",t,q\n0,0,1\n',
        "\ufeff" + HEAD + "0,0,1\n",
        "episode, t,q\n0,0,1\n",
        "episode,t,t\n0,0,1\n",
        "episode,,q\n0,0,1\n",
        "t,θ\n0,1\n",
        HEAD,
        "",
    ],
)
def test_it_is_what_pandas_reads(text, tmp_path):
    path = tmp_path / "recording.csv"
    path.write_text(text, encoding="utf-8", newline="")
    try:
        wanted = columns_of(read_frame(path, "round_trip"))
    except UsageError as error:
        with pytest.raises(UsageError) as caught:
            read_exactly(path)
        assert str(caught.value) == str(error)
        return
    found = read_exactly(path)
    assert list(found) == list(wanted)
    for name, values in found.items():
        if name == "episode" or wanted[name].dtype == object:
            assert values.astype(str).tolist() == wanted[name].astype(str).tolist()
        else:
            assert np.asarray(values, float).tobytes() == np.asarray(wanted[name], float).tobytes()


def test_pandas_is_not_loaded(tmp_path):
    (tmp_path / "recording.csv").write_text(HEAD + "0,0,1\n0,1,\n")
    code = (
        "import sys, pathlib; from gpsim.recordings.table_files import read_exactly\n"
        "read_exactly(pathlib.Path('recording.csv')); sys.exit('pandas' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False).returncode == 0
