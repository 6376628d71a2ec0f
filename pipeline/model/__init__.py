"""Stage 3: the theory. Knows no files and no other stage."""
