"""The trials' files: those that make the truth know nothing of what they judge, and optional programs wait."""

import subprocess
import sys


def test_optional_programs_are_loaded_when_they_are_needed():
    code = (
        "import sys, pkgutil, importlib, gpsim.trials as t\n"
        "[importlib.import_module(m.name) for m in pkgutil.walk_packages(t.__path__, 'gpsim.trials.')]\n"
        "sys.exit(any(name in sys.modules for name in ('mujoco', 'pysindy')) or 'gpsim.trials.sindy' not in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
