"""Sweeps: many scenes computed by many processes. Each point is stored when it is
finished; the table follows at the end.
"""
