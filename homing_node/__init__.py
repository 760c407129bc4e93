"""Homes machine axes."""
