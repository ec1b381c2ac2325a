"""What experiments share: domains, languages, measures, and the values that the paper reports."""
