"""Corrections: which change of the vehicle's coefficients explains what was measured, and whether data can tell."""
