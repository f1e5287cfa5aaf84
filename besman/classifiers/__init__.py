"""Classifiers of sequences: neighbours, hidden Markov models, warping, networks."""
