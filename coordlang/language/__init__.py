"""Words, sentences and language files."""
