"""ROS 2 bag folders: metadata.yaml names the storage files, which are read one after the other."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from gpsim.recordings.readers.container import Container, Message, Stream
from gpsim.recordings.readers.damage import DamageError, Ledger, one_line, refusal, regular_file
from gpsim.recordings.readers.definitions import DISTROS
