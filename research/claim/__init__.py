"""The paper's claim, put to the test: what a baseline must be to count, the search for such baselines, the map of the
claim over their gains, and the tables of docs/paper.md. research/paper_comparison.sh runs all of it.
"""
