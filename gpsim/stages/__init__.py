"""Stages: one file a command; inputs and configuration in, one artifact out."""

__all__ = [
    "build_residuals", "building", "collect", "diagnose", "diagnose_loop", "diagnosis_files",
    "evaluate_deployed", "export", "figures", "fit_gp", "fleet", "full_loop", "import_log", "iterate", "plan",
    "policy_files", "prove", "raw_logs", "registry", "report", "runs", "stage", "train_gp_policy",
    "try_effect", "watch",
]  # fmt: skip
