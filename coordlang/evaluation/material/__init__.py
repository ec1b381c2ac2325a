"""What experiments share: worlds, languages, trials, the values of the paper."""
