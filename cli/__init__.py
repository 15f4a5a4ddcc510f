"""The Typer app: parse, call a stage, print."""
