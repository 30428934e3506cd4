"""Sweeps: many scenes computed by many processes, kept point by point, fitted and drawn."""
