"""Drawing worlds from a seed and a trial's number."""
