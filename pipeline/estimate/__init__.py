"""Stage 2: records to speed and angle of attack, with 1-sigma."""
