"""Pictures, tables and pages of what was found."""

__all__ = [
    "canvas",
    "diagnosis_figures",
    "diagnosis_page",
    "diagnosis_text",
    "import_figure",
    "import_text",
    "loop_report",
    "not_asked_text",
    "page",
    "printable",
    "prove_page",
    "prove_record",
    "prove_sheets",
    "score_text",
    "slices",
    "tables",
    "trace_text",
    "trip_figures",
    "wording",
]
