"""Stages: one file a command; inputs and configuration in, one artifact out."""

__all__ = [
    "build_residuals",
    "building",
    "collect",
    "diagnose",
    "diagnose_loop",
    "diagnosis_files",
    "export_policy",
    "export_recording",
    "figures",
    "fit_gp",
    "full_loop",
    "import_log",
    "policy_files",
    "prove",
    "registry",
    "report",
    "score",
    "stage",
    "sweep",
    "train_gp_policy",
]
