"""Sweeps: many scenes computed by many processes, kept point by point, in a table at the end."""
