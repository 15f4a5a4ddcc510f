"""Pictures, tables and pages of what was found."""

__all__ = [
    "account", "account_effects", "account_lines", "bodies", "canvas", "diagnosis_figures", "diagnosis_page",
    "diagnosis_text", "fleet", "foxglove_file", "import_figure", "import_text", "loop_figures",
    "loop_page", "loop_report", "pages", "plan_page", "prove_page", "prove_sheets", "rerun_file", "robot_figure",
    "runs_text", "scene", "sheets", "statistics_text", "sweep_page", "wording",
]  # fmt: skip
