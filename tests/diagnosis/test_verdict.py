"""When an account is a partial one."""

from types import SimpleNamespace

import numpy as np
import pytest

from gpsim.diagnosis.judgement import verdict as judging
from gpsim.diagnosis.run import Run


@pytest.mark.parametrize(
    ("nats", "p_value", "lacking"),
    [(10.0, 0.5, False), (10.0, 1e-8, True), (900.0, 0.5, True), (0.2, 1e-20, False)],
)
def test_a_law_is_lacking_if_it_is_large_or_if_the_residual_is_not_white(nats, p_value, lacking):
    """A delay and a friction were once named though a rate limit of a thousand nats was left."""
    problem = SimpleNamespace(counts=np.array([1000.0]), observed=np.array([True]), run=Run())
    leader, null = SimpleNamespace(variance=np.array([1.0])), SimpleNamespace(variance=np.array([101.0]))
    lack = SimpleNamespace(significant=True, nats=nats)
    assert judging._lacking(problem, leader, null, lack, p_value) == lacking
    assert not judging._lacking(problem, leader, null, SimpleNamespace(significant=False), p_value)
