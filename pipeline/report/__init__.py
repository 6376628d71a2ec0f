"""Stage 4: measured against theory."""
