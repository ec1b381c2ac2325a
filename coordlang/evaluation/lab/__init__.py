"""The machinery of experiments: recipes, runs, results on disk, figures and the page."""
