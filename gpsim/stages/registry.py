"""All stages in the order of the loop."""

from __future__ import annotations

from collections.abc import Mapping

from gpsim.stages import (
    build_residuals,
    certify,
    collect,
    diagnose_loop,
    evaluate,
    fit_gp,
    train_gp_policy,
    train_source,
)
from gpsim.stages.stage import Stage

STAGES: Mapping[str, Stage] = {
    stage.name: stage
    for stage in (
        train_source.STAGE,
        collect.STAGE,
        build_residuals.STAGE,
        diagnose_loop.STAGE,
        fit_gp.STAGE,
        train_gp_policy.STAGE,
        certify.STAGE,
        evaluate.STAGE,
    )
}
