"""A language in use: say, understand, plan, act; and other planners join in."""
