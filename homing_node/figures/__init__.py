"""Diagrams and plots, and the records that they are drawn from."""
