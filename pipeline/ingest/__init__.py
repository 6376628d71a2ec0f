"""Stage 1: logs to canonical records."""
