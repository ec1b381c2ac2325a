"""Whether words are a coordination language, by definition, in code of its own."""
