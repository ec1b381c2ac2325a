"""Candidate tasks: what a language is to be guaranteed for."""
